/** Times in the page's time zone (the person's, or the lab's) and in this browser's format, with the zone. */

import { pageLanguage } from "./languages.js";

const DAY = { year: "numeric", month: "short", day: "numeric" };
const TIME = { hour: "2-digit", minute: "2-digit", timeZoneName: "short" };

/** The page's time zone; undefined (the browser's zone) if the browser does not know it. */
export function pageZone() {
  const timeZone = document.documentElement.dataset.zone;
  try {
    return new Intl.DateTimeFormat("en", { timeZone }).resolvedOptions().timeZone;
  } catch {
    return undefined;
  }
}

function text(at, options) {
  return new Intl.DateTimeFormat(pageLanguage(), { ...options, timeZone: pageZone() }).format(at);
}

/** The time of day, to the second. @param {Date} at */
export function timeText(at) {
  return text(at, { ...TIME, second: "2-digit" });
}

/** The time of day without a zone, "14:05:09". @param {Date} at */
export function clockText(at) {
  const time = { hour: "2-digit", minute: "2-digit", second: "2-digit", hourCycle: "h23" };
  return new Intl.DateTimeFormat("en-GB", { ...time, timeZone: pageZone() }).format(at);
}

/**
 * The offset of a moment in the page's zone, " (UTC+2)", if clocks go back and show its time of day twice; else "".
 * @param {Date} at
 */
export function offsetIfTwice(at) {
  const clock = clockText(at);
  const twice = [-60, -30, 30, 60].some(
    (minutes) => clockText(new Date(at.getTime() + minutes * 60_000)) === clock,
  );
  if (!twice) return "";
  const options = { timeZone: pageZone(), timeZoneName: "shortOffset" };
  const parts = new Intl.DateTimeFormat("en", options).formatToParts(at);
  return ` (${parts.find(({ type }) => type === "timeZoneName").value.replace("GMT", "UTC")})`;
}

/** The time if it was today, else the day and the time. @param {string} at as the console sends it */
export function whenText(at, now = new Date()) {
  const when = new Date(at);
  return text(when, text(when, DAY) === text(now, DAY) ? TIME : { ...DAY, ...TIME });
}
