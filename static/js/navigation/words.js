/** Texts about drives to a place. Pure. */

import { number } from "../formats/numbers.js";

const THERE = ["arrived", "done"]; // the words of navigation, and of a drive by a distance

/** Return a text about the end of a drive. @param {{outcome: string, text: string}} end */
function endText({ outcome, text }) {
  if (THERE.includes(outcome)) return gettext("The robot is there.");
  if (outcome === "replaced")
    return gettext("The stick took over: the drive to the place has ended.");
  if (outcome === "cancelled") return gettext("The drive to the place was cancelled.");
  if (outcome === "held_back")
    return gettext("Stopped on its way: something is there, or its sensors see too little");
  if (outcome === "no_progress") return gettext("Stopped on its way: it did not move any more");
  return interpolate(gettext("The drive has ended: %s"), [text]);
}

/** Return the notice of a drive's end; `stays`: it ended otherwise than wanted. */
export function endNotice(ended) {
  const level = [...THERE, "cancelled", "replaced"].includes(ended.outcome) ? "success" : "warning";
  const isBad = level === "warning"; // then the place for the reason has it
  const text = endText(ended);
  return {
    level,
    code: `go ${ended.fence} ${ended.seq}`,
    text,
    detail: ended.text,
    quiet: isBad,
    stays: isBad,
  };
}

/**
 * "Drives to “kitchen”: 2.4 m left, 12 s on the way".
 * @param {{left_m: ?number, since_s: number, ending: string, place: string}} going
 */
export function goingText({ left_m: left, since_s: since, ending = "", place = "" }) {
  const drives = place
    ? interpolate(gettext("Drives to “%s”"), [place])
    : gettext("Drives to a place");
  if (ending) return interpolate(gettext("%s: is being ended"), [drives]);
  const seconds = Math.round(since);
  return left === null || left === undefined
    ? interpolate(gettext("%s: %s s on the way"), [drives, seconds])
    : interpolate(gettext("%s: %s m left, %s s on the way"), [drives, number(left, 1), seconds]);
}
