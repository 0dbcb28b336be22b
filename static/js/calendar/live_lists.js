/**
 * Lists of bookings that stay true while the page is open: parts with `data-live` and an id. When a booking has
 * changed, the page is read again, and the parts that differ are replaced.
 */

import { atMost, listen } from "./live.js";

const READS_MS = 3000; // between two reads when many book at once
const TOKEN = /name="csrfmiddlewaretoken" value="[^"]*"/g; // another one in each answer

/** Whether somebody is at work in a part: it must not change under their hands. */
function isInUse(part) {
  return part.contains(document.activeElement) || document.querySelector("dialog[open]") !== null;
}

/**
 * Replace the parts that differ from those of a page that was read.
 * @param {string} html @returns {boolean} whether a part must wait, because somebody is at work in it
 */
export function bringUpToDate(html) {
  const read = new DOMParser().parseFromString(html, "text/html");
  let waits = false;
  for (const part of document.querySelectorAll("[data-live]")) {
    const newer = read.getElementById(part.id);
    const same = newer?.innerHTML.replace(TOKEN, "") === part.innerHTML.replace(TOKEN, "");
    if (!newer || same) continue;
    if (isInUse(part)) waits = true;
    else part.replaceChildren(...newer.childNodes);
  }
  return waits;
}

async function readAgain(again) {
  if (document.hidden) return;
  const headers = { Accept: "text/html", "X-Live": "1" }; // without messages: they are for the page that comes next
  const answer = await fetch(location.href, { headers }).catch(() => null);
  if (answer?.ok && !answer.redirected && bringUpToDate(await answer.text())) again();
}

/** Keep the lists of this page true. @param {string} path of the WebSocket */
export function keepFresh(path) {
  const changed = atMost(() => readAgain(changed), READS_MS);
  let isFirst = true; // the hint when the socket opens: the page is new
  listen(path, () => {
    if (!isFirst) changed();
    isFirst = false;
  });
  document.addEventListener("visibilitychange", changed);
}

if (document.querySelector("[data-live]")) keepFresh("/ws/bookings/");
