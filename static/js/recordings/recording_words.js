/** Recordings in words. Pure. */

import { number } from "../formats/numbers.js";
import { spanText } from "../formats/spans.js";

const UNITS = ["B", "kB", "MB", "GB", "TB"];

/** Return bytes as "1.3 GB". */
export function sizeText(bytes) {
  let [value, unit] = [bytes, 0];
  for (; value >= 1000 && unit < UNITS.length - 1; unit += 1) value /= 1000;
  return `${number(value, unit === 0 || value >= 100 ? 0 : 1)} ${UNITS[unit]}`;
}

/** Whether a recording goes on; else it ended by a fault, or there is none. */
export function goesOn(recording) {
  return Boolean(recording) && !(recording.refusal && recording.left_s <= 0);
}

/** Return lines about the recording of a state: who, since when, how much. */
export function recordingLines(recording) {
  if (!goesOn(recording)) return [gettext("Nothing is recorded now.")];
  const { by, since_s: sinceS, left_s: leftS, bytes = 0, bytes_per_s: rate = 0 } = recording;
  const { free_bytes: free = null, dropped = 0, left_out: leftOut = 0 } = recording;
  return [
    interpolate(gettext("%s records this robot, since %s."), [by, spanText(sinceS)]),
    interpolate(gettext("%s, %s each second."), [sizeText(bytes), sizeText(rate)]),
    free === null ? "" : interpolate(gettext("Room for %s more."), [sizeText(free)]),
    interpolate(gettext("It ends by itself in %s."), [spanText(leftS)]),
    dropped
      ? interpolate(ngettext("%s message is missing.", "%s messages are missing.", dropped), [
          dropped,
        ])
      : "",
    leftOut
      ? interpolate(
          ngettext(
            "%s topic is left out: a recording has 300 at most.",
            "%s topics are left out: a recording has 300 at most.",
            leftOut,
          ),
          [leftOut],
        )
      : "",
  ].filter(Boolean);
}

/** Return a line about the black box; empty: it does not run. */
export function blackBoxText(box) {
  if (!box) return "";
  if (box.refusal) return box.refusal.text;
  return interpolate(
    gettext(
      "The black box holds the last %s s. A stop, a fault, a contact and “Keep this” keep 30 s before and 15 s after.",
    ),
    [box.seconds ?? 0],
  );
}

/** Return what a recorded view says of the robot. A file names nobody: "…" stands for each name. */
export function saysOf({ state: { verdict, text } }) {
  const holds = !["free", "idle"].includes(verdict.code);
  return (holds ? verdict.text : text).replace(/(?<!\S)…/g, gettext("somebody"));
}
