/** Numbers in the page's language. Pure. */

import { pageLanguage } from "./languages.js";

/** `Intl.NumberFormat` objects, by language and digits. */
const known = new Map();

/**
 * Return a number as text: 0.40 in English, 0,40 in Spanish.
 * @param {number} value
 * @param {number} [digits] after the decimal sign; without it, as many as the number has
 */
export function number(value, digits) {
  const key = `${pageLanguage()} ${digits}`;
  if (!known.has(key))
    known.set(
      key,
      new Intl.NumberFormat(pageLanguage(), {
        minimumFractionDigits: digits ?? 0,
        maximumFractionDigits: digits ?? 10,
        useGrouping: false,
      }),
    );
  return known.get(key).format(value);
}
