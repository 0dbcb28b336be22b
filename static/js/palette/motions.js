/** The robot's motions in the palette. */

import { whyNotNow } from "../control/lease.js";
import { leftOf } from "../tasks/lesson_tasks.js";
import { worded } from "../tasks/motion_words.js";
import { durationText } from "../tasks/motions.js";

/** @param {import("./control_palette.js").Driving} driving @returns {import("./palette.js").Entry[]} */
export function motions({ offers, tasks, mayAct, request }) {
  const all = worded(offers().motions ?? []);
  const offered = leftOf(tasks(), "motions", all, ({ name }) => name);
  const why = () => offers().uses?.motions?.refusal?.text || (mayAct() ? "" : whyNotNow());
  return offered.map(({ name, title, usage = "", description = "", duration_s: seconds }) => ({
    name: title || name,
    does: [gettext("Motion: the robot plays it"), durationText(seconds), description]
      .filter(Boolean)
      .join(" · "),
    more: `${name} ${usage}`,
    why,
    act: () => request({ t: "play", motion: name, title: title || name }),
  }));
}
