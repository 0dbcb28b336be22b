/** Ages in words, the same wherever a page says how old something is. Pure. */

import { number } from "./numbers.js";

/** Return a short age: "0.4 s", "4 s", "3 min". @param {number} ms */
export function ageText(ms) {
  const seconds = ms / 1000;
  if (seconds >= 120) return interpolate(gettext("%s min"), [Math.round(seconds / 60)]);
  const [shown, digits] = seconds < 1 ? [seconds, 1] : [Math.round(seconds), 0];
  return interpolate(gettext("%s s"), [number(shown, digits)]);
}
