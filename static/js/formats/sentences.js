/**
 * Sentences of the console in the page's language. A message has its texts in English; `said` has the key in the
 * catalogue and the figures of those that contain figures. robots/shared/sentences.py makes them, with the same formats.
 */

import { pageLanguage } from "./languages.js";
import { number } from "./numbers.js";
import { offsetIfTwice, pageZone } from "./times.js";

// Fields with a sentence
const TOLD = new Set([
  "text",
  "detail",
  "ending",
  "motions_text",
  "navigation_held",
  "problem",
  "reason",
  "stick",
  "warning",
]);
// Fields that nobody reads as a sentence: numbers, and values of a robot's messages
const RAW = new Set(["arm", "fields", "joints", "message", "odometry", "said", "scan", "value"]);
const FIGURE = /\{(\w+)(?::([^}]*))?\}/g;

function moment(options) {
  return (at) =>
    new Intl.DateTimeFormat(pageLanguage(), { timeZone: pageZone(), ...options }).format(
      new Date(at),
    );
}

function clock(options) {
  const text = moment({ ...options, ...CLOCK });
  return (at) => text(at) + offsetIfTwice(new Date(at));
}

const CLOCK = { hour: "2-digit", minute: "2-digit", hourCycle: "h23" };
const DAY = { day: "2-digit", month: "short", year: "numeric" };

const FORMATS = {
  fine: (value) => number(value, value >= 0.095 ? 1 : 2),
  age: (seconds) => {
    if (seconds >= 120) return `${number(seconds / 60, 0)} min`;
    return `${number(seconds, seconds < 60 ? 1 : 0)} s`;
  },
  bare: (text) => text.replace(/\.+$/, ""),
  capital: (text) => text.charAt(0).toLocaleUpperCase(pageLanguage()) + text.slice(1),
  clock: clock({}),
  // A day has no zone
  day: (day) => moment({ ...DAY, timeZone: "UTC" })(day.slice(0, 10)),
  when: clock({ weekday: "short", ...DAY }),
};

function shown(value, format = "") {
  const said = Array.isArray(value) ? sentence(value) : value;
  if (FORMATS[format]) return FORMATS[format](said);
  if (typeof said !== "number") return said ?? "";
  const [, digits] = format.match(/^\.(\d)f$/) ?? [];
  return number(said, digits && Number(digits));
}

/** Return a sentence with its figures. @param {[string, object?, string?]} said key, figures, key of many */
export function sentence([key, figures = {}, many = ""]) {
  const text = many ? ngettext(key, many, figures.count) : gettext(key);
  return text.replace(FIGURE, (_, name, format) => shown(figures[name], format));
}

/**
 * Return a message of the console with its sentences in the page's language.
 * A text in a language of its own (`language`: speech, phrases) stays as it is.
 */
export function inPageLanguage(message) {
  return pageLanguage().startsWith("en") ? message : translated(message);
}

function translated(value) {
  if (Array.isArray(value)) return value.map(translated);
  if (value === null || typeof value !== "object") return value;
  const has = Object.entries(value).map(([name, part]) => [name, ofField(value, name, part)]);
  return Object.fromEntries(has);
}

function ofField(owner, name, part) {
  if (RAW.has(name)) return part;
  if (Array.isArray(part) && owner.said?.[name]) return owner.said[name].map(sentence);
  if (typeof part !== "string") return translated(part);
  if (!TOLD.has(name) || !part || "language" in owner) return part;
  return owner.said?.[name] ? sentence(owner.said[name]) : gettext(part);
}
