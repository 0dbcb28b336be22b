/** From what a thumb or a gamepad says to the axes of the stick: dead zone, curve, rounding. */

import { NEUTRAL } from "./stick.js";

const STICK_DEAD_ZONE = 0.08;
const GAMEPAD_DEAD_ZONE = 0.15;

/** Nothing within the dead zone, and the full range still reachable beyond it. */
export function withoutDeadZone(value, deadZone) {
  const size = Math.min(Math.abs(value), 1);
  if (!(size > deadZone)) return 0;
  return (Math.sign(value) * (size - deadZone)) / (1 - deadZone);
}

/** Fine near the middle, full at the rim. */
export function curve(value) {
  return 0.5 * value + 0.5 * value ** 3;
}

function shape(value, deadZone) {
  const shaped = Math.round(curve(withoutDeadZone(value, deadZone)) * 1000) / 1000;
  return shaped === 0 ? 0 : shaped; // never -0
}

/**
 * The joystick on the page. `right` and `up` run from -1 to 1.
 * @param {boolean} slides sideways means sliding (holonomic bases) and not turning
 */
export function fromJoystick({ right, up }, slides) {
  const x = shape(up, STICK_DEAD_ZONE);
  const sideways = shape(-right, STICK_DEAD_ZONE);
  if (x === 0 && sideways === 0) return NEUTRAL;
  return slides ? { x, y: sideways, w: 0 } : { x, y: 0, w: sideways };
}

/**
 * A gamepad with the standard mapping: the left stick drives, the right one turns. On a base that cannot
 * slide the left stick turns as well.
 * @param {readonly number[]} axes right is positive, down is positive
 */
export function fromGamepad(axes, holonomic) {
  const [leftX = 0, leftY = 0, rightX = 0] = axes;
  const x = shape(-leftY, GAMEPAD_DEAD_ZONE);
  const sideways = shape(-leftX, GAMEPAD_DEAD_ZONE);
  const turn = shape(-rightX, GAMEPAD_DEAD_ZONE);
  if (holonomic) return { x, y: sideways, w: turn };
  return { x, y: 0, w: Math.abs(turn) > Math.abs(sideways) ? turn : sideways };
}
