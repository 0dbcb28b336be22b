/** Times in this browser's format, with the zone, because records use UTC. */

import { pageLanguage } from "./languages.js";

const DAY = { year: "numeric", month: "short", day: "numeric" };
const TIME = { hour: "2-digit", minute: "2-digit", timeZoneName: "short" };

/** The time of day, to the second. @param {Date} at */
export function timeText(at) {
  return at.toLocaleTimeString(pageLanguage(), { ...TIME, second: "2-digit" });
}

/** The time if it was today, else the day and the time. @param {string} at as the console writes it */
export function whenText(at, now = new Date()) {
  const when = new Date(at);
  const options = when.toDateString() === now.toDateString() ? TIME : { ...DAY, ...TIME };
  return new Intl.DateTimeFormat(pageLanguage(), options).format(when);
}
