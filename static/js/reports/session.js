/**
 * The page of a control session: a person chooses a moment, and picture and timeline show it. Without this
 * script, the page has both without the choice.
 */

import { readingKey } from "../formats/languages.js";
import { clockText } from "../formats/times.js";
import { parts, setText, show } from "../lib/dom.js";
import { lastAt, placeAt } from "./replay.js";

const page = parts(document.querySelector("[data-page=session]"));
const { lastsS, beganAt, drives } = JSON.parse(document.getElementById("replay").textContent);
const entries = [...page.timeline.querySelectorAll("[data-at]")];
const timesS = entries.map((entry) => Number(entry.dataset.at));
let current = null;

/** Return the time of day, in the zone of the page. */
function clock(atS) {
  return clockText(new Date(Date.parse(beganAt) + atS * 1000));
}

function words(entry) {
  const parts = entry.querySelectorAll(".what, .subject");
  return [...parts].map((element) => element.textContent).join(": ");
}

function showMoment(atS) {
  const place = placeAt(drives, atS);
  if (place && page.marker) {
    const { x, y, degrees, moving } = place;
    page.marker.setAttribute("transform", `translate(${x} ${y}) rotate(${degrees})`);
    page.marker.setAttribute("visibility", "visible");
    page.marker.toggleAttribute("data-still", !moving);
  }
  const entry = entries[lastAt(timesS, atS)] ?? null;
  const moving = place?.moving ? gettext("driving") : gettext("standing");
  setText(page["moment-words"], `${clock(atS)} · ${moving}`);
  setText(page.says, entry ? words(entry) : "");
  page.moment.setAttribute(
    "aria-valuetext",
    [clock(atS), moving, page.says.textContent].join(", "),
  );
  if (entry === current) return;
  current?.removeAttribute("aria-current");
  entry?.setAttribute("aria-current", "true");
  current = entry;
  bringIntoSight(entry);
}

/** Scroll the timeline to an entry; the page itself does not scroll. */
function bringIntoSight(entry) {
  if (!entry) return;
  const list = page.timeline.getBoundingClientRect();
  const { top, bottom } = entry.getBoundingClientRect();
  if (top < list.top) page.timeline.scrollTop -= list.top - top;
  else if (bottom > list.bottom) page.timeline.scrollTop += bottom - list.bottom;
}

function go(atS) {
  page.moment.value = String(atS);
  showMoment(Number(page.moment.value));
}

/** Go to the next entry at another time, or to the entry before. */
function step(forward) {
  const atS = Number(page.moment.value);
  const found = forward
    ? timesS.find((time) => time > atS)
    : timesS.findLast((time) => time < (timesS[lastAt(timesS, atS)] ?? 0));
  if (found !== undefined) go(found);
}

page.moment.max = String(Math.max(lastsS, timesS.at(-1) ?? 0));
page.moment.addEventListener("input", () => showMoment(Number(page.moment.value)));
// The slider's own steps are as fine as the timeline: keys move by 1 or 10 seconds.
page.moment.addEventListener("keydown", (event) => {
  const way = {
    ArrowRight: 1,
    ArrowUp: 1,
    ArrowLeft: -1,
    ArrowDown: -1,
    PageUp: 10,
    PageDown: -10,
  };
  const seconds = way[readingKey(event.key)];
  if (!seconds || event.altKey || event.ctrlKey || event.metaKey) return;
  event.preventDefault();
  go(Number(page.moment.value) + seconds);
});
page.before.addEventListener("click", () => step(false));
page.after.addEventListener("click", () => step(true));
page.timeline.addEventListener("click", ({ target }) => {
  const entry = target.closest("[data-at]");
  if (entry && !target.closest("a")) go(Number(entry.dataset.at));
});

if (entries.length > 0) {
  page.timeline.dataset.scrubbed = "";
  show(page.scrub, true);
  go(timesS[0]);
}
