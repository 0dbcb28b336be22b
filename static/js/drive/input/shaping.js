/** Converts positions of joystick and gamepad to the axes of the stick: rim, dead zone, curve, rounding. */

import { NEUTRAL } from "./stick.js";

const STICK_DEAD_ZONE = 0.08;
const GAMEPAD_DEAD_ZONE = 0.15;

/** Return zero within the dead zone; the rest is scaled to the full range. */
export function withoutDeadZone(value, deadZone) {
  const size = Math.min(Math.abs(value), 1);
  if (!(size > deadZone)) return 0;
  return (Math.sign(value) * (size - deadZone)) / (1 - deadZone);
}

/** Return a value that grows slowly near the middle, for fine driving, and reaches 1 at the rim. */
export function curve(value) {
  return 0.5 * value + 0.5 * value ** 3;
}

/**
 * Stretch a position so that the larger axis is full at the round rim. Forward and turn are two speeds, each
 * with its own maximum: so a bend is driven as fast as by keys. The direction, and with it the bend, does not
 * change.
 */
export function fullAtRim(x, y) {
  const longest = Math.max(Math.abs(x), Math.abs(y));
  const stretch = longest > 0 ? Math.hypot(x, y) / longest : 1;
  return [x * stretch, y * stretch];
}

function shape(value, deadZone) {
  const shaped = Math.round(curve(withoutDeadZone(value, deadZone)) * 1000) / 1000;
  return shaped === 0 ? 0 : shaped; // never -0
}

/**
 * Return the axes for the joystick on the page. `right` and `up` go from -1 to 1.
 * @param {boolean} slides sideways means sliding (holonomic bases) and not turning
 */
export function fromJoystick({ right, up }, slides) {
  const [x, sideways] = leftStick(up, -right, slides, STICK_DEAD_ZONE);
  if (x === 0 && sideways === 0) return NEUTRAL;
  return slides ? { x, y: sideways, w: 0 } : { x, y: 0, w: sideways };
}

/**
 * Return the axes for a gamepad with the standard mapping: the left stick drives, the right one turns. On a
 * base that cannot slide the left stick turns as well.
 * @param {readonly number[]} axes right is positive, down is positive
 */
export function fromGamepad(axes, holonomic) {
  const [right = 0, down = 0, turnRight = 0] = axes;
  const [x, sideways] = leftStick(-down, -right, holonomic, GAMEPAD_DEAD_ZONE);
  const turn = shape(-turnRight, GAMEPAD_DEAD_ZONE);
  if (holonomic) return { x, y: sideways, w: turn };
  return { x, y: 0, w: Math.abs(turn) > Math.abs(sideways) ? turn : sideways };
}

/** Return forward and sideways. Sliding has one speed in all directions, so its rim stays round. */
function leftStick(forward, left, slides, deadZone) {
  const axes = slides ? [forward, left] : fullAtRim(forward, left);
  return axes.map((axis) => shape(axis, deadZone));
}
