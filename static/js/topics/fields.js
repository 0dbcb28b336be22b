/** A message's fields, as rows with dotted paths. Pure. */

import { number } from "../formats/numbers.js";

export const PATHS_AT_MOST = 400; // rows of one message: nobody would read more

const NO_NUMBERS = new Set(["NaN", "Infinity", "-Infinity"]); // strings in JSON

/**
 * Return every field of a message, in order. `kind` is the kind of row: a "branch" with other rows below it,
 * a "number", "numbers" in a list, or "text" for all other values.
 * @param {object} fields
 * @param {Set<string>} opened paths of lists of numbers that have a row for each element
 * @returns {{path: string, value: any, depth: number, kind: string, isOpen: boolean}[]}
 */
export function rows(fields, opened = new Set(), prefix = "", depth = 0, found = []) {
  const entries = Array.isArray(fields) ? fields.entries() : Object.entries(fields);
  for (const [name, value] of entries) {
    if (found.length >= PATHS_AT_MOST) break;
    const path = Array.isArray(fields) ? `${prefix}[${name}]` : prefix ? `${prefix}.${name}` : name;
    const kind = kindOf(value);
    const isOpen = kind === "branch" || (kind === "numbers" && opened.has(path));
    found.push({ path, value, depth, kind, isOpen });
    if (isOpen) rows(value, opened, path, depth + 1, found);
  }
  return found;
}

/** Return the kind of a value's row. A list of plain values is one row. */
function kindOf(value) {
  if (isNumeric(value)) return "number";
  if (value === null || typeof value !== "object") return "text";
  if (!Array.isArray(value)) return "branch";
  if (value.some((item) => item !== null && typeof item === "object")) return "branch";
  return value.length > 0 && value.every(isNumeric) ? "numbers" : "text";
}

/** Return the number at a path of `rows`; null if there is none. */
export function numberAt(fields, path) {
  let value = fields;
  for (const step of path.match(/[^.[\]]+/g) ?? []) value = value?.[step];
  if (typeof value === "boolean") return Number(value);
  return typeof value === "number" ? value : null;
}

function isNumeric(value) {
  return typeof value === "number" || typeof value === "boolean" || NO_NUMBERS.has(value);
}

/** Return the text of a value; of a list that is shown in part, with its whole length. */
export function valueText(value, wholeLength = null) {
  if (Array.isArray(value)) {
    const shown = value.map((item) => valueText(item)).join(", ");
    const more = wholeLength === null ? "" : `, … (${wholeLength})`;
    return `[${shown}${more}]`;
  }
  if (typeof value === "number") return numberText(value);
  return typeof value === "string" ? value : JSON.stringify(value);
}

function numberText(value) {
  if (Number.isInteger(value)) return String(value);
  const size = Math.abs(value);
  return size !== 0 && (size < 1e-3 || size >= 1e6) ? value.toExponential(3) : value.toFixed(3);
}

/** Rate, size, publisher and age of a sample, in words. */
export function figuresText(message) {
  if (!message.number) return publishersText(message);
  const { rate_hz: rateHz, bytes } = message;
  return [rateText(rateHz), sizeText(bytes), publishersText(message), ageText(message)]
    .filter(Boolean)
    .join(" · ");
}

/** Return the text of a type: the robot's master does not know all types. */
export function typeText(type) {
  return type === "*" ? gettext("type not known") : type;
}

function rateText(rateHz) {
  if (rateHz === null) return gettext("one message so far");
  return `${number(rateHz, rateHz >= 10 ? 0 : rateHz >= 1 ? 1 : 2)} Hz`;
}

function ageText({ age_s: ageS, since_s: sinceS }) {
  if (typeof ageS === "number") {
    const text = ageS < 0 ? gettext("stamped %s ahead") : gettext("stamped %s ago");
    return interpolate(text, [durationText(Math.abs(ageS))]);
  }
  if (typeof sinceS !== "number") return "";
  return sinceS < 1 ? gettext("just now") : interpolate(gettext("%s ago"), [durationText(sinceS)]);
}

function durationText(seconds) {
  if (seconds < 10) return interpolate(gettext("%s s"), [number(seconds, seconds < 1 ? 2 : 1)]);
  if (seconds < 120) return interpolate(gettext("%s s"), [Math.round(seconds)]);
  const minutes = seconds / 60;
  if (minutes < 120) return interpolate(gettext("%s min"), [Math.round(minutes)]);
  const hours = minutes / 60;
  if (hours < 48) return interpolate(gettext("%s h"), [Math.round(hours)]);
  return interpolate(gettext("%s days"), [Math.round(hours / 24)]);
}

function publishersText({ publishers, publisher_names: names = [] }) {
  const count = interpolate(ngettext("%s publisher", "%s publishers", publishers), [publishers]);
  return names.length ? `${count}: ${names.join(", ")}` : count;
}

function sizeText(bytes) {
  if (bytes < 1000) return `${bytes} B`;
  return bytes < 1e6 ? `${number(bytes / 1000, 1)} kB` : `${number(bytes / 1e6, 1)} MB`;
}
