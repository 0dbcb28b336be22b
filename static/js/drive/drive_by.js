/** A drive by a distance or an angle: shown while it runs, and why it ended otherwise than wanted. */

import { number } from "../formats/numbers.js";
import { endNotice } from "../navigation/words.js";
import { NewEnds } from "../tasks/task_ends.js";

/**
 * Return a text about a drive by a distance or an angle, with the part that is done. Robots report radians.
 */
export function driveText({
  goal_m: goalM,
  goal_rad: goalRad,
  distance_m: doneM,
  angle_rad: doneRad,
}) {
  const degrees = (radians) => Math.round((radians * 180) / Math.PI);
  return goalRad === null
    ? interpolate(gettext("Drives: %s of %s m"), [number(doneM, 1), number(goalM, 1)])
    : interpolate(gettext("Turns: %s of %s°"), [degrees(doneRad), degrees(goalRad)]);
}

export class DriveBy {
  static hears = ["state.drive_by"];
  static task = "drive_by";
  static requests = {
    drive_by: {
      name: ({ title, distance_m: metres }) =>
        title ?? (metres ? gettext("Back off") : gettext("Turn and look")),
    },
    drive_by_cancel: { name: () => gettext("Cancel the drive"), ends: true },
  };

  #ends;

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ notify }) {
    this.#ends = new NewEnds((ended) => {
      const notice = endNotice(ended);
      if (notice.stays) notify(notice);
    });
  }

  /** @param {{now: ?object, ended: ?object}} drive */
  set drive_by({ ended }) {
    this.#ends.follow({ ended });
  }

  shows({ now }) {
    return now && { words: driveText(now), who: now.who, cancel: [{ t: "drive_by_cancel" }] };
  }
}
