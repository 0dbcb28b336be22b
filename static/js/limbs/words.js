/** Texts about gripper and torso. Pure. */

import { number } from "../formats/numbers.js";

/** Return a length in centimetres, the unit in which people think of a hand's width. */
export function centimetres(metres) {
  return interpolate(gettext("%s cm"), [number(metres * 100, metres < 0.1 ? 1 : 0)]);
}

export function limbName(limb) {
  return limb === "gripper" ? gettext("Gripper") : gettext("Torso");
}

/** Return the limbs that move, each with its state. @param {object} limbs of the robot's state */
export function movesOf(limbs) {
  return Object.entries(limbs).filter(([, { to_m: toM = null }]) => toM !== null);
}

/**
 * Return a text about the running moves; empty if there are none.
 * @param {object} limbs of the robot's state
 */
export function movingText(limbs = {}) {
  return movesOf(limbs)
    .map(([limb, { at_m: atM, to_m: toM, ending = "" }]) => {
      const now = atM === null ? "?" : centimetres(atM);
      const moves = interpolate(gettext("%s: %s, to %s"), [limbName(limb), now, centimetres(toM)]);
      return ending ? `${moves}. ${ending}` : moves;
    })
    .join("; ");
}

const HOLDING = new Set(["no_progress", "stalled"]); // the gripper perhaps holds an object
const QUIET = new Set(["done", "cancelled", "replaced", "stopped"]);

/** Return the notice of a move's end; null if the end needs no notice. */
export function endNotice(limb, { outcome, text, at_m: atM }) {
  if (QUIET.has(outcome)) return null;
  const outcomes = {
    no_progress: gettext("%s: stopped on its way."),
    stalled: gettext("%s: stopped on its way."),
    not_there: gettext("%s: not where it should be."),
    rejected: gettext("%s: the robot did not accept it."),
    failed: gettext("%s: failed."),
    taken_over: gettext("%s: taken over."),
    control_ended: gettext("%s: cancelled, because control ended."),
    link_lost: gettext("%s: cancelled, because the page was out of reach."),
    not_watched: gettext("%s: cancelled, because joint states ended."),
    arm_away: gettext("%s: cancelled, because the arm is not at home."),
    unheard: gettext("%s: its controller does not answer."),
  };
  const words = interpolate(outcomes[outcome] ?? gettext("%s: ended."), [limbName(limb)]);
  const where = atM === null ? "" : interpolate(gettext("It is at %s."), [centimetres(atM)]);
  return {
    level: HOLDING.has(outcome) && limb === "gripper" ? "info" : "warning",
    code: `limb ${limb} ${outcome}`,
    text: [words, text, /\d m\b/.test(text) ? "" : where].filter(Boolean).join(" "),
  };
}
