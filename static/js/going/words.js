/** Texts about a short way to a point. Pure. */

import { number } from "../formats/numbers.js";
import { FARTHEST_M } from "./way.js";

/** Return why the robot should not drive a way; empty: it may. @param {import("./way.js").Way} way */
export function problemText({ problem, freeM }) {
  const metres = (value) => number(value, 1);
  switch (problem) {
    case "far":
      return interpolate(gettext("Too far: at most %s m"), [metres(FARTHEST_M)]);
    case "turn":
      return gettext("No room to turn");
    case "blocked":
      return interpolate(gettext("Blocked after %s m"), [metres(freeM)]);
    default:
      return "";
  }
}

/** Return the words beside the buttons. @param {import("./way.js").Way} way */
export function wayText(way) {
  return problemText(way) || interpolate(gettext("%s m away"), [number(way.distanceM, 1)]);
}
