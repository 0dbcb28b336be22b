/** Where names are written on the map, so that they lie neither on the robot or a goal nor on each other. Pure. */

const HALF_HEIGHT = 9; // pixels
const BELOW = 13; // pixels from a point to the middle of its name

/**
 * A name: its point and half its width, in pixels.
 *
 * @typedef {{text: string, left: number, top: number, half: number}} Label
 */

/**
 * Return the middle of each name: below its point; else above it or beside it, where nothing else is.
 * @param {Label[]} labels those that come first have the first choice
 * @param {{left: number, top: number, radius: number}[]} marks that names must not cover
 * @param {number} width of the map's picture: names stay inside
 * @returns {{left: number, top: number}[]}
 */
export function placed(labels, marks, width) {
  const taken = [];
  return labels.map(({ left, top, half }) => {
    const inside = (middle) => Math.max(half, Math.min(middle, width - half));
    const spots = [
      [left, top + BELOW],
      [left, top - BELOW],
      [left + half + BELOW, top],
      [left - half - BELOW, top],
    ].map(([middle, height]) => ({ left: inside(middle), top: height, half }));
    const isFree = (spot) =>
      !taken.some((other) => overlaps(spot, other)) && !marks.some((mark) => covers(spot, mark));
    const spot = spots.find(isFree) ?? spots[0];
    taken.push(spot);
    return spot;
  });
}

function overlaps(one, other) {
  return (
    Math.abs(one.left - other.left) < one.half + other.half &&
    Math.abs(one.top - other.top) < 2 * HALF_HEIGHT
  );
}

function covers({ left, top, half }, mark) {
  const beside = Math.max(Math.abs(left - mark.left) - half, 0);
  const above = Math.max(Math.abs(top - mark.top) - HALF_HEIGHT, 0);
  return Math.hypot(beside, above) < mark.radius;
}
