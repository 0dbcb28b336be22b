/** The meaning of the darkest and the brightest grey of a picture of depth or heat. */

import { number } from "../formats/numbers.js";

const SMALL_PX = 300; // pictures that are not higher are shown small
const SHARES = { small: 10, large: 20 }; // such a picture is so many times as high as the text
const FINE_M = 0.5; // shorter ranges have two decimals

/**
 * @param {?{low: ?number, high: ?number, unit: string}} scale as the console sends it; null: an ordinary picture
 * @returns {string} empty for an ordinary picture
 */
export function scaleText(scale) {
  if (!scale) return "";
  const { low, high, unit } = scale;
  if (low === null) return gettext("no pixel has a value");
  if (!unit) return interpolate(gettext("%s to %s"), [low, high]);
  const decimals = high - low < FINE_M ? 2 : 1;
  const ends = [low, high].map((end) => number(end, decimals));
  return interpolate(gettext("%s to %s m"), ends);
}

/** Write the text into the picture's corner, so that files and small views have it, too. */
export function paintScale(pen, text, width, height) {
  if (!text) return;
  const size = Math.round(height / (height <= SMALL_PX ? SHARES.small : SHARES.large));
  pen.font = `${size}px sans-serif`;
  pen.textBaseline = "bottom";
  pen.fillStyle = "#000000b3";
  pen.fillRect(0, height - 1.4 * size, Math.min(width, (text.length + 1) * size * 0.6), 1.4 * size);
  pen.fillStyle = "#fff";
  pen.fillText(text, size / 3, height - size / 5, width);
}
