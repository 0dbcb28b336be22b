/** Texts about where a robot is on the fleet map. Pure. */

import { isSeen, unknownText } from "../control/status/status_text.js";
import { number } from "../formats/numbers.js";

const THERE_M = 0.5;
const NEAR_M = 2;

/**
 * Return why a robot is on no map; empty: it is on a map.
 * @param {?object} map of the robot
 * @param {object} robot as sent
 */
export function whyNowhere(map, { state, refusal, seen_at: seenAt = null }) {
  if (!state) return refusal?.text ?? gettext("It sends no data.");
  if (!isSeen(state)) return interpolate(gettext("Position: %s"), [unknownText(seenAt)]);
  if (!map)
    return gettext("The server has no map of it yet: it reads the map while somebody has control.");
  if (!state.location) return gettext("It does not know where it is on its map.");
  return "";
}

/** "Near “kitchen”", or the coordinates. @param {object} location @param {object[]} places */
export function whereText(location, places) {
  if (location.problem) return location.problem;
  const apart = (place) => Math.hypot(place.x - location.x, place.y - location.y);
  const nearest = [...places].sort((one, other) => apart(one) - apart(other))[0];
  if (nearest && apart(nearest) <= NEAR_M)
    return interpolate(apart(nearest) <= THERE_M ? gettext("At “%s”") : gettext("Near “%s”"), [
      nearest.name,
    ]);
  return interpolate(gettext("At %s m, %s m of the map"), [
    number(location.x, 1),
    number(location.y, 1),
  ]);
}
