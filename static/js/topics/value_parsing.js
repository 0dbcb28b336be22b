/** Typed texts for a message's fields, as values for JSON. Whole numbers keep all their digits. Pure. */

const WHOLE = /^u?int(8|16|32|64)$|^byte$|^char$/;
const FRACTION = /^float(32|64)$/;

/** The first value of a field. */
export function blankText(type) {
  if (type === "time") return "now";
  if (type === "duration" || WHOLE.test(type) || FRACTION.test(type)) return "0";
  return "";
}

/** A written value as the definition wants it. Throws an Error with words for a person. */
export function parsed(text, { type, constants = {} }) {
  if (type === "string") return text;
  const trimmed = text.trim();
  if (Object.hasOwn(constants, trimmed)) return constants[trimmed];
  if (type === "bool") return truth(trimmed);
  if (type === "time" && trimmed === "now") return "now";
  if (trimmed === "") throw new Error(gettext("Write a number."));
  const value = Number(trimmed);
  if (!Number.isFinite(value)) throw new Error(gettext("This is not a number."));
  if (!WHOLE.test(type)) return value;
  if (!Number.isInteger(value)) throw new Error(gettext("Write a whole number."));
  return exact(value, trimmed);
}

/** An array as it is written: values with commas between, or a JSON list. */
export function parsedArray(text, field) {
  const trimmed = text.trim();
  const values = trimmed.startsWith("[") ? parsedList(trimmed) : split(trimmed, field);
  if (field.array > 0 && values.length !== field.array) {
    throw new Error(interpolate(gettext("Write exactly %s values."), [field.array]));
  }
  return values;
}

/** JSON, of which no whole number loses digits. Throws a SyntaxError, or an Error with words for a person. */
export function parsedJson(text) {
  return JSON.parse(text, (_key, value, { source = "" } = {}) =>
    typeof value === "number" && !/[.e]/i.test(source) ? exact(value, source) : value,
  );
}

function parsedList(text) {
  try {
    return parsedJson(text);
  } catch (error) {
    if (error instanceof SyntaxError)
      throw new Error(gettext("Write a JSON list, such as [1, 2]."));
    throw error;
  }
}

function split(text, field) {
  return text === "" ? [] : text.split(",").map((part) => parsed(part.trim(), field));
}

function truth(text) {
  if (text === "true" || text === "1") return true;
  if (text === "false" || text === "0") return false;
  throw new Error(gettext("Write true or false."));
}

/** A number that is whole. A browser's own numbers round those beyond 2^53. */
function exact(value, text) {
  if (!Number.isInteger(value) || Number.isSafeInteger(value)) return value;
  if (!JSON.rawJSON || !text) {
    throw new Error(gettext("This browser would lose digits of this: publish it with a program."));
  }
  return JSON.rawJSON(String(/^[+-]?\d+$/.test(text) ? BigInt(text) : BigInt(value)));
}
