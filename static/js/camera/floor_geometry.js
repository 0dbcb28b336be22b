/**
 * The robot's path on the floor, and the floor in a camera's picture. Pure. Base frame: x forward, y left,
 * metres. `lens` and `pose` are those of a picture's header: pinhole (fx, fy, cx, cy), and 3 x 4 matrix from
 * the base frame to the optical frame (z into the picture, x right, y down).
 */

import {
  carried,
  distanceTo,
  isWithin,
  moves,
  poseAfter,
  reach,
  sweptArea,
  withArm,
} from "../drive/twist_geometry.js";

const FAR_M = 4; // length of the path that is drawn, at any speed, like the parking aid of a car
const MOST_TURN = Math.PI / 2; // radians
const STEP_M = 0.05;
const RED_M = 0.25; // distance to the end of the path
const YELLOW_M = 0.7;
const SHOWN_S = 2; // the outline shows the robot after this time, as in the picture from above
const NEAREST_M = 0.05; // before the lens; nearer points and points behind the lens are not in the picture
const HINTED_M = 1.5;

/** Return the twist to draw for a verdict: the allowed twist, or the asked twist if no motion is allowed. */
function shownTwist({ asked, allowed }) {
  const [vx, vy, w] = moves(allowed) ? allowed : asked;
  return { vx, vy, w };
}

/** Return the shortest way to any of the points [x0, y0, x1, y1, ...] (cm), or to the gate's own obstacle. */
function contactOf(obstacle, flatCm, outline, travelTo) {
  let shortest = Infinity;
  if (obstacle) shortest = isWithin(outline, obstacle) ? 0 : travelTo(obstacle);
  for (let i = 0; i < flatCm.length; i += 2) {
    const point = [flatCm[i] / 100, flatCm[i + 1] / 100];
    const travelM = travelTo(point);
    // A point inside the outline counts only if it is the gate's own obstacle.
    if (travelM < shortest && !isWithin(outline, point)) shortest = travelM;
  }
  return shortest;
}

/**
 * Return the least distance of a known point outside the footprint from it; Infinity if farther than `mostM`.
 */
function leastGap(footprint, obstacle, flatCm, mostM) {
  const farM = reach(footprint) + mostM;
  let least =
    obstacle && !isWithin(footprint, obstacle) ? distanceTo(footprint, obstacle) : Infinity;
  for (let i = 0; i < flatCm.length; i += 2) {
    const point = [flatCm[i] / 100, flatCm[i + 1] / 100];
    if (Math.hypot(...point) > farM || isWithin(footprint, point)) continue;
    least = Math.min(least, distanceTo(footprint, point));
  }
  return least;
}

function tierAt(leftM) {
  if (leftM <= RED_M) return "red";
  return leftM <= YELLOW_M ? "yellow" : "green";
}

/**
 * Return the metres that a twist drives until the gate would stop the robot before a known obstacle; Infinity: none
 * is in the way. As the gate does, it widens the footprint by the lateral margin, or by the gap if that is smaller,
 * and keeps the front margin before the first contact.
 * @param {?number[]} obstacle the gate's own
 */
export function freeWay(
  footprint,
  twist,
  obstacle,
  flatCm,
  { front_margin_m: frontM, lateral_margin_m: besideM },
) {
  const gapM = Math.min(besideM, leastGap(footprint, obstacle, flatCm, besideM) - 1e-4);
  const outline = withArm(
    footprint,
    footprint.map(([x, y]) => [x, y, Math.max(0, gapM)]),
  );
  const contactM = contactOf(obstacle, flatCm, outline, sweptArea(outline, twist).travelTo);
  return Math.max(0, contactM - frontM);
}

/**
 * Return the path in front of the robot, to where the gate would stop before a known obstacle, or to the
 * longest length.
 * @param {number[][]} footprint
 * @param {object} verdict of the gate
 * @param {number[]} flatCm known obstacles [x0, y0, x1, y1, ...], centimetres
 * @param {{front_margin_m: number, lateral_margin_m: number}} margins that the gate leaves, as in the robot's
 *   facts
 * @returns {{bands: {tier: string, outline: number[][]}[], stop: ?number[][], later: ?number[][]}}
 *   `bands` by tier (green, yellow, red: how near the end is), the nearest first; `stop`: both ends of the
 *   line where the gate stops the robot; `later`: the footprint two seconds later. All are empty if no
 *   drive is asked, or if the robot turns on the spot.
 */
export function floorPath(footprint, verdict, flatCm, margins) {
  const twist = shownTwist(verdict);
  const speed = Math.hypot(twist.vx, twist.vy);
  if (!moves([twist.vx, twist.vy, 0])) return { bands: [], stop: null, later: null };
  const nose = Math.max(...footprint.map(([x, y]) => (twist.vx * x + twist.vy * y) / speed));
  const farM = Math.min(FAR_M, (MOST_TURN * speed) / Math.abs(twist.w));
  const isHeld = !moves(verdict.allowed);
  const { bordersAt } = sweptArea(footprint, twist);
  const freeM = freeWay(footprint, twist, verdict.point, flatCm, margins);
  const goesM = isHeld ? 0 : Math.min(freeM, farM);
  const isStopped = isHeld || freeM <= farM;
  const tierOf = (atM) => (isStopped ? tierAt(nose + goesM - atM) : "green");
  const later = poseAfter(twist, Math.min(speed * SHOWN_S, goesM) / speed);
  return {
    bands: bandsTo(nose + goesM, bordersAt, isHeld ? () => "red" : tierOf),
    stop: isStopped ? bordersAt(nose + goesM) : null,
    later: isHeld ? null : carried(footprint, later),
  };
}

/** Return one outline for each stretch of a tier: many small outlines side by side would show seams. */
function bandsTo(endM, bordersAt, tierOf) {
  const steps = Math.max(1, Math.ceil(endM / STEP_M));
  const bands = [];
  for (let i = 0; i < steps; i += 1) {
    const [from, to] = [(endM * i) / steps, (endM * (i + 1)) / steps];
    const tier = tierOf(to);
    if (bands.at(-1)?.tier !== tier) {
      const [left, right] = bordersAt(from);
      bands.push({ tier, left: [left], right: [right] });
    }
    const [left, right] = bordersAt(to);
    bands.at(-1).left.push(left);
    bands.at(-1).right.unshift(right);
  }
  return bands.map(({ tier, left, right }) => ({ tier, outline: [...left, ...right] }));
}

/** Convert a point of the floor to the optical frame. */
export function seen([x, y], m) {
  return [m[0] * x + m[1] * y + m[3], m[4] * x + m[5] * y + m[7], m[8] * x + m[9] * y + m[11]];
}

function pixel([x, y, z], [fx, fy, cx, cy]) {
  return [cx + (fx * x) / z, cy + (fy * y) / z];
}

/**
 * Return the point of the floor at a pixel: the inverse of `inPicture`. Null: the pixel is at the horizon or above.
 * @param {number[]} pixel of the header's size
 * @param {object} header of the picture, with lens and pose
 */
export function floorAt([u, v], { lens: [fx, fy, cx, cy], pose: m }) {
  const ray = [(u - cx) / fx, (v - cy) / fy, 1];
  const [x, y, z] = [0, 1, 2].map(
    (axis) => m[axis] * ray[0] + m[4 + axis] * ray[1] + m[8 + axis] * ray[2],
  );
  if (z >= 0) return null;
  const stand = standOf(m);
  const share = -stand.height / z;
  return [stand.x + share * x, stand.y + share * y];
}

/** Convert an outline on the floor to pixels of the header's size, without the part behind the camera. */
export function inPicture(outline, { lens, pose }) {
  const corners = outline.map((point) => seen(point, pose));
  const clipped = [];
  for (let i = 0; i < corners.length; i += 1) {
    const [a, b] = [corners[i], corners[(i + 1) % corners.length]];
    if (a[2] >= NEAREST_M) clipped.push(a);
    if (a[2] >= NEAREST_M !== b[2] >= NEAREST_M) {
      const fraction = (NEAREST_M - a[2]) / (b[2] - a[2]);
      clipped.push(a.map((value, axis) => value + fraction * (b[axis] - value)));
    }
  }
  return clipped.map((corner) => pixel(corner, lens));
}

function wrapped(angle) {
  return Math.atan2(Math.sin(angle), Math.cos(angle));
}

/** Return position and heading of the camera on the floor plan, and its height. */
function standOf(m) {
  const at = (column) => -(m[column] * m[3] + m[4 + column] * m[7] + m[8 + column] * m[11]);
  return { x: at(0), y: at(1), height: at(2), heading: Math.atan2(m[9], m[8]) };
}

/**
 * Return the near obstacles that the picture does not show: for each edge of the picture the nearest
 * obstacle.
 * @param {number[]} flatCm points [x0, y0, x1, y1, ...], centimetres
 * @param {object} header of the picture, with lens and pose
 * @returns {{edge: "left" | "right" | "bottom", at: number, distanceM: number}[]} `at`: share of the edge,
 *   from the left or from the top; an obstacle farther behind is lower on the left or right edge
 */
export function edgeHints(flatCm, header) {
  const stand = standOf(header.pose);
  const nearest = {};
  for (let i = 0; i < flatCm.length; i += 2) {
    const point = [flatCm[i] / 100, flatCm[i + 1] / 100];
    const distanceM = Math.hypot(...point);
    if (distanceM > HINTED_M) continue;
    const hint = hintOf(point, header, stand);
    if (hint && distanceM < (nearest[hint.edge]?.distanceM ?? Infinity))
      nearest[hint.edge] = { ...hint, distanceM };
  }
  return Object.values(nearest);
}

function hintOf(point, { lens, pose, width, height }, { x, y, heading }) {
  const [fx, , cx] = lens;
  const corner = seen(point, pose);
  if (corner[2] >= NEAREST_M) {
    const [u, v] = pixel(corner, lens);
    if (u >= 0 && u <= width && v <= height) return null; // in the picture, or above it
  }
  const turn = wrapped(Math.atan2(point[1] - y, point[0] - x) - heading); // positive: to the left
  const limit = turn > 0 ? Math.atan2(cx, fx) : Math.atan2(width - cx, fx);
  if (Math.abs(turn) <= limit) return { edge: "bottom", at: (cx - fx * Math.tan(turn)) / width };
  const behind = (Math.abs(turn) - limit) / (Math.PI - limit);
  return { edge: turn > 0 ? "left" : "right", at: (1 + behind) / 2 };
}
