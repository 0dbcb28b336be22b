/** Converts colours of the style sheet, in any CSS notation, to numbers. */

/** @param {string} css @returns {{colour: number, opacity: number}} */
export function numbersOf(css) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 1;
  const pen = canvas.getContext("2d", { willReadFrequently: true });
  if (!pen) return { colour: 0x808080, opacity: 1 };
  pen.fillStyle = css;
  pen.fillRect(0, 0, 1, 1);
  const [red, green, blue, alpha] = pen.getImageData(0, 0, 1, 1).data;
  return { colour: (red << 16) | (green << 8) | blue, opacity: alpha / 255 };
}
