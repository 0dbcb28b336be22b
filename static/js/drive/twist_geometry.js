/** Plane geometry of the base frame: x forward, y left, metres and radians. */

const STRAIGHT_RADPS = 1e-4;
const NEARLY_STRAIGHT = 1e-3; // rad/s per m/s
const SLOWEST_SHOWN = 0.01; // m/s or rad/s

/** Return whether a twist is fast enough to draw its path. @param {number[]} twist vx, vy, w */
export function moves(twist) {
  return twist.some((value) => Math.abs(value) > SLOWEST_SHOWN);
}

/**
 * Return the pose of the base after driving a constant twist for some time: on an arc, or on a line.
 * @param {{vx: number, vy: number, w: number}} twist
 * @param {number} seconds
 * @returns {{x: number, y: number, yaw: number}}
 */
export function poseAfter({ vx, vy, w }, seconds) {
  const yaw = w * seconds;
  if (Math.abs(w) < STRAIGHT_RADPS) return { x: vx * seconds, y: vy * seconds, yaw };
  const s = Math.sin(yaw) / w;
  const c = (1 - Math.cos(yaw)) / w;
  return { x: vx * s - vy * c, y: vx * c + vy * s, yaw };
}

/** Return the poses along the arc of a twist, including the last one. */
export function arc(twist, seconds, steps) {
  return Array.from({ length: steps }, (_, i) => poseAfter(twist, (seconds * (i + 1)) / steps));
}

/** An outline [[x, y], ...] moved to a pose. */
export function carried(outline, { x, y, yaw }) {
  const c = Math.cos(yaw);
  const s = Math.sin(yaw);
  return outline.map(([px, py]) => [x + px * c - py * s, y + px * s + py * c]);
}

const DISC_CORNERS = 16;

/**
 * Return the convex outline around a base and its arm.
 * @param {number[][]} footprint of the base
 * @param {number[][]} discs [x, y, radius] of the arm; without discs, the result is the footprint
 * @returns {number[][]} counter-clockwise
 */
export function withArm(footprint, discs) {
  if (discs.length === 0) return footprint;
  const round = discs.flatMap(([x, y, radius]) =>
    Array.from({ length: DISC_CORNERS }, (_, i) => {
      const angle = (2 * Math.PI * i) / DISC_CORNERS;
      return [x + radius * Math.cos(angle), y + radius * Math.sin(angle)];
    }),
  );
  const points = [...footprint, ...round].sort(([ax, ay], [bx, by]) => ax - bx || ay - by);
  return [...halfHull(points), ...halfHull(points.reverse())];
}

/** The lower half of the convex hull of sorted points, without its last corner. */
function halfHull(points) {
  const hull = [];
  for (const [x, y] of points) {
    while (hull.length > 1) {
      const [[ax, ay], [bx, by]] = hull.slice(-2);
      if ((bx - ax) * (y - ay) > (by - ay) * (x - ax)) break;
      hull.pop();
    }
    hull.push([x, y]);
  }
  return hull.slice(0, -1);
}

/** Return the radius of the circle around the base's centre that contains an outline. */
export function reach(outline) {
  return Math.max(0, ...outline.map(([x, y]) => Math.hypot(x, y)));
}

/** The edges of a closed outline. @returns {[number[], number[]][]} both ends of each */
function edgesOf(outline) {
  return outline.map((start, i) => [start, outline[(i + 1) % outline.length]]);
}

/** Return whether a point is inside a closed outline. */
export function isWithin(outline, [x, y]) {
  let isInside = false;
  for (const [[ax, ay], [bx, by]] of edgesOf(outline))
    if (ay > y !== by > y && x < ax + ((y - ay) / (by - ay)) * (bx - ax)) isInside = !isInside;
  return isInside;
}

/** Return the distance of a point from the edges of a closed outline. */
export function distanceTo(outline, [x, y]) {
  const about = outline.map(([px, py]) => [px - x, py - y]);
  return Math.min(...edgesOf(about).map(nearestOf));
}

/**
 * Return the floor that an outline sweeps while it drives a constant twist. The linear speed must not be
 * zero.
 * @param {number[][]} outline closed, around the base
 * @param {{vx: number, vy: number, w: number}} twist
 * @returns {{bordersAt: (atM: number) => number[][], travelTo: (point: number[]) => number}} `bordersAt`:
 *   left and right border after `atM` metres. `travelTo`: metres until the outline touches a point outside of
 *   it; Infinity: the outline passes the point
 */
export function sweptArea(outline, twist) {
  const speed = Math.hypot(twist.vx, twist.vy);
  return Math.abs(twist.w) < NEARLY_STRAIGHT * speed
    ? sweptAhead(outline, twist.vx / speed, twist.vy / speed)
    : sweptRound(outline, twist, speed);
}

function sweptAhead(outline, dx, dy) {
  const onWay = ([x, y]) => [dx * x + dy * y, dx * y - dy * x]; // along, and to the left
  const edges = edgesOf(outline.map(onWay));
  const sides = edges.map(([[, side]]) => side);
  const [right, left] = [Math.min(...sides), Math.max(...sides)];
  const beside = (along, side) => [dx * along - dy * side, dy * along + dx * side];
  const travelTo = (point) => {
    const [along, side] = onWay(point);
    let shortest = Infinity;
    if (side <= right || side >= left) return shortest;
    for (const [[a, sideA], [b, sideB]] of edges) {
      if (sideA > side === sideB > side) continue;
      const travelM = along - (a + ((side - sideA) / (sideB - sideA)) * (b - a));
      if (travelM >= 0) shortest = Math.min(shortest, travelM);
    }
    return shortest;
  };
  return { bordersAt: (atM) => [beside(atM, left), beside(atM, right)], travelTo };
}

function sweptRound(outline, twist, speed) {
  const { vx, vy, w } = twist;
  const [cx, cy] = [-vy / w, vx / w]; // the centre of the turn
  const edges = edgesOf(outline.map(([x, y]) => [x - cx, y - cy]));
  const radiusM = speed / Math.abs(w);
  const outer = Math.max(...edges.map(([start]) => Math.hypot(...start)));
  const inner = isWithin(outline, [cx, cy]) ? 0 : Math.min(...edges.map(nearestOf));
  const bordersAt = (atM) => {
    const { x, y } = poseAfter(twist, atM / speed);
    const [ex, ey] = [(x - cx) / radiusM, (y - cy) / radiusM];
    const at = (r) => [cx + ex * r, cy + ey * r];
    return w > 0 ? [at(inner), at(outer)] : [at(outer), at(inner)];
  };
  const travelTo = ([px, py]) => {
    const [x, y] = [px - cx, py - cy];
    const away = Math.hypot(x, y);
    let shortest = Infinity;
    if (away <= inner || away >= outer) return shortest;
    const bearing = Math.atan2(y, x);
    for (const [hitX, hitY] of edges.flatMap((edge) => atDistance(edge, away))) {
      const turn = (bearing - Math.atan2(hitY, hitX)) * Math.sign(w);
      shortest = Math.min(shortest, (turn < 0 ? turn + 2 * Math.PI : turn) % (2 * Math.PI));
    }
    return shortest * radiusM;
  };
  return { bordersAt, travelTo };
}

/** Return the least distance of an edge from the origin. */
function nearestOf([[ax, ay], [bx, by]]) {
  const [ex, ey] = [bx - ax, by - ay];
  const at = Math.min(1, Math.max(0, -(ax * ex + ay * ey) / (ex ** 2 + ey ** 2)));
  return Math.hypot(ax + at * ex, ay + at * ey);
}

/** Return the points of an edge, at most two, at this distance from the origin. */
function atDistance([[ax, ay], [bx, by]], distance) {
  const [ex, ey] = [bx - ax, by - ay];
  const square = ex ** 2 + ey ** 2;
  const half = (ax * ex + ay * ey) / square;
  const root = Math.sqrt(half ** 2 - (ax ** 2 + ay ** 2 - distance ** 2) / square); // NaN: no such point
  return [-half - root, -half + root]
    .filter((at) => at >= 0 && at <= 1)
    .map((at) => [ax + at * ex, ay + at * ey]);
}

/** Metres from the robot to the edge of the view: the smallest that shows most laser points is used. */
const SPANS_M = [2, 3, 4.5, 6.5];
const SHOWN_SHARE = 0.7;
// The span changes only if the share is clearly off: the picture must not zoom all the time.
const CALM = 0.08;

/**
 * The span that shows a scan well.
 * @param {readonly number[]} laserCm flat [x0, y0, x1, y1, ...]
 * @param {number} current the span shown now
 */
export function spanFor(laserCm, current) {
  const total = laserCm.length / 2;
  if (total === 0) return current;
  const shareWithin = (span) => {
    let inside = 0;
    for (let i = 0; i < laserCm.length; i += 2) {
      if (Math.hypot(laserCm[i], laserCm[i + 1]) <= span * 100) inside += 1;
    }
    return inside / total;
  };
  const fitting = SPANS_M.find((span) => shareWithin(span) >= SHOWN_SHARE) ?? SPANS_M.at(-1);
  if (fitting > current) return shareWithin(current) < SHOWN_SHARE - CALM ? fitting : current;
  return fitting < current && shareWithin(fitting) > SHOWN_SHARE + CALM ? fitting : current;
}
