/** What a message holds, as rows with dotted paths. Pure. */

export const PATHS_AT_MOST = 400; // rows of one message; more would be a page nobody reads

/** @returns {{path: string, value: any, depth: number, leaf: boolean}[]} every field below a message, in its order */
export function rows(fields, prefix = "", depth = 0, found = []) {
  const entries = Array.isArray(fields) ? fields.entries() : Object.entries(fields);
  for (const [name, value] of entries) {
    if (found.length >= PATHS_AT_MOST) break;
    const path = Array.isArray(fields) ? `${prefix}[${name}]` : prefix ? `${prefix}.${name}` : name;
    const leaf = value === null || typeof value !== "object" || isFlat(value);
    found.push({ path, value, depth, leaf });
    if (!leaf) rows(value, path, depth + 1, found);
  }
  return found;
}

/** A list of plain values is one row. */
function isFlat(value) {
  return Array.isArray(value) && value.every((item) => item === null || typeof item !== "object");
}

/** The number at a path, as `rows` writes it; null where there is none. */
export function numberAt(fields, path) {
  let value = fields;
  for (const step of path.match(/[^.[\]]+/g) ?? []) value = value?.[step];
  if (typeof value === "boolean") return Number(value);
  return typeof value === "number" ? value : null;
}

export function isNumeric(value) {
  return typeof value === "number" || typeof value === "boolean";
}

/** A value as a person reads it; a list with what of it is not shown. */
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

/** Whole lengths by path, of lists that are shown in part: "ranges (666)". */
export function wholeLengths(shortened) {
  return new Map(
    shortened.map((entry) => {
      const [, path, length] = entry.match(/^(.*) \((\d+)\)$/);
      return [path, Number(length)];
    }),
  );
}

/** How big, how often: in words. */
export function figuresText(message) {
  const { rate_hz: rateHz, bytes, age_s: ageS } = message;
  const said = [
    rateHz === null ? gettext("rate not known yet") : `${rateHz.toFixed(rateHz < 10 ? 1 : 0)} Hz`,
    sizeText(bytes),
    publishersText(message),
  ];
  if (ageS !== null && ageS !== undefined) {
    said.push(interpolate(gettext("stamped %s s ago"), [ageS.toFixed(ageS < 10 ? 2 : 0)]));
  }
  return said.join(" · ");
}

function publishersText({ publishers, publisher_names: names = [] }) {
  const count = interpolate(ngettext("%s publisher", "%s publishers", publishers), [publishers]);
  return names.length ? `${count}: ${names.join(", ")}` : count;
}

function sizeText(bytes) {
  if (bytes < 1000) return `${bytes} B`;
  return bytes < 1e6 ? `${(bytes / 1000).toFixed(1)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}
