/** Converts typed texts for a message's fields to JSON values. Whole numbers keep all their digits. Pure. */

const WHOLE = /^u?int(8|16|32|64)$|^byte$|^char$/;
const FRACTION = /^float(32|64)$/;
const TIME = /^(time|builtin_interfaces\/Time)$/; // of ROS 1, of ROS 2
const DURATION = /^(duration|builtin_interfaces\/Duration)$/;

/** Return the text with which a field begins. */
export function blankText(type) {
  if (TIME.test(type)) return "now";
  if (DURATION.test(type) || WHOLE.test(type) || FRACTION.test(type)) return "0";
  return "";
}

/** Convert a written value to the type of its definition. Throws an Error with a sentence for people. */
export function parsed(text, { type, constants = {} }) {
  if (type === "string") return text;
  const trimmed = text.trim();
  if (Object.hasOwn(constants, trimmed)) return constants[trimmed];
  if (type === "bool") return truth(trimmed);
  if (TIME.test(type) && trimmed === "now") return "now";
  if (trimmed === "") throw new Error(gettext("Write a number."));
  const value = Number(trimmed);
  if (!Number.isFinite(value)) throw new Error(gettext("This is not a number."));
  if (!WHOLE.test(type)) return value;
  if (!Number.isInteger(value)) throw new Error(gettext("Write a whole number."));
  return exact(value, trimmed);
}

/** Convert a written array: values with commas between, or a JSON list. */
export function parsedArray(text, field) {
  const trimmed = text.trim();
  const values = trimmed.startsWith("[") ? parsedList(trimmed) : split(trimmed, field);
  if (field.array > 0 && values.length !== field.array) {
    throw new Error(interpolate(gettext("Write exactly %s values."), [field.array]));
  }
  return values;
}

/**
 * Parse JSON; whole numbers keep all digits. Throws a SyntaxError, or an Error with a sentence for people.
 */
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

/** Return a whole number with all its digits: a browser's own numbers are rounded beyond 2^53. */
function exact(value, text) {
  if (!Number.isInteger(value) || Number.isSafeInteger(value)) return value;
  if (!JSON.rawJSON || !text) {
    throw new Error(gettext("This browser would lose digits of this: publish it with a program."));
  }
  return JSON.rawJSON(String(/^[+-]?\d+$/.test(text) ? BigInt(text) : BigInt(value)));
}
