/**
 * The visible part of the map: converts metres of the map to pixels of the page, and back. Pure. North is up.
 */

export const FINEST = 200; // pixels per metre
const MARGIN = 0.04; // share of the picture, around the whole map
const NOTHING = { left: 0, right: 0, above: 0, below: 0 };

/**
 * @typedef {{x: number, y: number, scale: number}} Frame the point in the middle (m), and pixels per metre
 */

/**
 * Return the frame that shows all these corners (m).
 * @param {{left: number, right: number, above: number, below: number}} covered pixels at the sides
 */
export function whole(corners, width, height, covered = NOTHING) {
  const xs = corners.map(([x]) => x);
  const ys = corners.map(([, y]) => y);
  const [west, east, south, north] = [
    Math.min(...xs),
    Math.max(...xs),
    Math.min(...ys),
    Math.max(...ys),
  ];
  const room = 1 - 2 * MARGIN;
  const { left, right, above, below } = covered;
  const wanted = Math.min(
    (room * Math.max(width - left - right, width / 3)) / Math.max(east - west, 0.1),
    (room * Math.max(height - above - below, height / 3)) / Math.max(north - south, 0.1),
  );
  const scale = Math.min(wanted, FINEST);
  const [moved, lifted] = [(left - right) / 2 / scale, (below - above) / 2 / scale];
  return { x: (west + east) / 2 - moved, y: (south + north) / 2 - lifted, scale };
}

/**
 * Return the corners of a map, counter-clockwise from its origin.
 * @param {object} map as the API describes it
 */
export function corners({ origin_x_m: x, origin_y_m: y, origin_rad: yaw, ...map }) {
  const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
  const [w, h] = [map.width * map.resolution_m, map.height * map.resolution_m];
  return [
    [0, 0],
    [w, 0],
    [w, h],
    [0, h],
  ].map(([along, up]) => [x + c * along - s * up, y + s * along + c * up]);
}

export function toPixels({ x, y, scale }, point, width, height) {
  return [width / 2 + (point[0] - x) * scale, height / 2 - (point[1] - y) * scale];
}

export function toPoint({ x, y, scale }, pixel, width, height) {
  return [x + (pixel[0] - width / 2) / scale, y - (pixel[1] - height / 2) / scale];
}

/**
 * Zoom by a factor; the point of the map at this pixel does not move.
 * @param {number} coarsest pixels per metre
 */
export function zoomed(frame, factor, pixel, width, height, coarsest) {
  const least = Math.min(coarsest, frame.scale); // a larger window has a larger `coarsest`
  const scale = Math.min(Math.max(frame.scale * factor, least), FINEST);
  const [x, y] = toPoint(frame, pixel, width, height);
  return {
    x: x - (pixel[0] - width / 2) / scale,
    y: y + (pixel[1] - height / 2) / scale,
    scale,
  };
}

/** Move the visible part by a number of pixels. */
export function panned({ x, y, scale }, dx, dy) {
  return { x: x - dx / scale, y: y + dy / scale, scale };
}

/** Return the heading of a drag, radians; `otherwise` if the drag is shorter than `least` pixels. */
export function headingOf(from, to, otherwise, least = 12) {
  const [dx, dy] = [to[0] - from[0], from[1] - to[1]];
  return Math.hypot(dx, dy) < least ? otherwise : Math.atan2(dy, dx);
}

/**
 * Convert a point of the base frame (cm) to a point of the map (m).
 * @param {{x: number, y: number, heading: number}} robot
 */
export function onMap({ x, y, heading }, pointCm) {
  const [c, s] = [Math.cos(heading), Math.sin(heading)];
  const [ahead, left] = [pointCm[0] / 100, pointCm[1] / 100];
  return [x + c * ahead - s * left, y + s * ahead + c * left];
}
