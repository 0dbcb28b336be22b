/** A short way over the floor: a turn on the spot, then straight on. Pure. Base frame, metres and radians. */

import { freeWay } from "../camera/floor_geometry.js";
import { carried, isWithin, reach, sweptArea } from "../drive/twist_geometry.js";

export const FARTHEST_M = 3;
const LEAST_TURN = 0.03; // radians: less is not worth a request, and misses a point 3 m away by 9 cm
const TURN_STEP = 0.1; // radians between two positions in which the turning outline is checked

/**
 * A way, and where it ends.
 *
 * @typedef {object} Way
 * @property {number} turnRad on the spot; 0: the robot looks there already
 * @property {number} distanceM straight on after the turn
 * @property {number} freeM of that distance, until the gate would stop the robot before a known obstacle
 * @property {"" | "far" | "turn" | "blocked"} problem why nobody should drive it: too far; no room to turn;
 *   something is in the way
 * @property {number[][]} ghost the outline at its end
 * @property {number[]} nose of the ghost: the point where its heading arrow ends
 * @property {number[][]} floor the corners of the floor between both outlines
 */

/**
 * Return the way to a point.
 * @param {number[]} point
 * @param {number[][]} outline of the robot with its arm
 * @param {number[]} flatCm known obstacles [x0, y0, x1, y1, ...], centimetres
 * @param {{front_margin_m: number, lateral_margin_m: number}} margins that the gate leaves
 * @returns {Way}
 */
export function wayTo([x, y], outline, flatCm, margins) {
  const distanceM = Math.hypot(x, y);
  const bearing = Math.atan2(y, x);
  const turnRad = Math.abs(bearing) < LEAST_TURN ? 0 : bearing;
  const known = pointsOf(flatCm);
  const ahead = carried(known, { x: 0, y: 0, yaw: -turnRad });
  const freeM = freeWay(
    outline,
    { vx: 1, vy: 0, w: 0 },
    null,
    ahead.flat().map((metres) => 100 * metres),
    margins,
  );
  const turned = carried(outline, { x: 0, y: 0, yaw: bearing });
  const { bordersAt } = sweptArea(turned, { vx: x / distanceM, vy: y / distanceM, w: 0 });
  const [left, right] = bordersAt(0);
  const [leftEnd, rightEnd] = bordersAt(distanceM);
  const tip = 0.8 * Math.max(...outline.map(([along]) => along));
  return {
    turnRad,
    distanceM,
    freeM,
    problem: problemOf(distanceM, freeM, hasRoomToTurn(outline, turnRad, known)),
    ghost: carried(outline, { x, y, yaw: bearing }),
    nose: carried([[tip, 0]], { x, y, yaw: bearing })[0],
    floor: [left, leftEnd, rightEnd, right],
  };
}

function problemOf(distanceM, freeM, hasRoom) {
  if (distanceM > FARTHEST_M) return "far";
  if (!hasRoom) return "turn";
  return freeM < distanceM ? "blocked" : "";
}

function pointsOf(flatCm) {
  const points = [];
  for (let i = 0; i < flatCm.length; i += 2) points.push([flatCm[i] / 100, flatCm[i + 1] / 100]);
  return points;
}

/** Return whether a turning outline touches no known point that is outside of it now. */
function hasRoomToTurn(outline, turnRad, known) {
  const farM = reach(outline);
  const near = known.filter((point) => Math.hypot(...point) <= farM && !isWithin(outline, point));
  const steps = Math.ceil(Math.abs(turnRad) / TURN_STEP);
  for (let i = 1; i <= steps && near.length > 0; i += 1) {
    const turned = carried(outline, { x: 0, y: 0, yaw: (turnRad * i) / steps });
    if (near.some((point) => isWithin(turned, point))) return false;
  }
  return true;
}

/**
 * Convert a point between the base frame and the odometry's frame, in which it stays while the robot moves.
 * @param {{x: number, y: number, yaw: number}} base the robot's pose by odometry
 */
export function onFloor(point, base) {
  return carried([point], base)[0];
}

export function fromBase([x, y], base) {
  return carried([[x - base.x, y - base.y]], { x: 0, y: 0, yaw: -base.yaw })[0];
}
