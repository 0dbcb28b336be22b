/**
 * One picture of a camera, as a binary frame: length of the header (4 bytes), header (JSON), encoded picture.
 * Pure.
 */

const LENGTH_BYTES = 4;
const LONGEST_SIDE = 4096; // pixels: a larger picture would fill the memory of a phone

/**
 * @param {ArrayBuffer} frame
 * @returns {{header: object, bytes: Uint8Array} | null} null: the frame has no picture
 */
export function unpacked(frame) {
  if (frame.byteLength < LENGTH_BYTES) return null;
  const length = new DataView(frame).getUint32(0);
  if (length > frame.byteLength - LENGTH_BYTES) return null;
  try {
    const text = new TextDecoder().decode(new Uint8Array(frame, LENGTH_BYTES, length));
    const header = JSON.parse(text);
    return { header, bytes: new Uint8Array(frame, LENGTH_BYTES + length) };
  } catch {
    return null;
  }
}

/** Return whether a picture of this size can be shown. */
export function fits({ width, height }) {
  return width > 0 && height > 0 && width <= LONGEST_SIDE && height <= LONGEST_SIDE;
}

/** Return the pixel of a picture under a spot of the box that it covers. */
export function pixelUnder([left, top], header, boxWidth, boxHeight) {
  const { scale, x, y } = covering(header, boxWidth, boxHeight);
  return [(left - x) / scale, (top - y) / scale];
}

/**
 * Return scale and position of a picture that covers a box, as the style sheet places it: its middle and its lower
 * edge, which shows the floor before the robot, are in the box.
 * @returns {{scale: number, x: number, y: number}}
 */
export function covering({ width, height }, boxWidth, boxHeight) {
  const scale = Math.max(boxWidth / width, boxHeight / height);
  return { scale, x: (boxWidth - width * scale) / 2, y: boxHeight - height * scale };
}
