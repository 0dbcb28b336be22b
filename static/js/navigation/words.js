/** Drives to a place, in words. Pure. */

/** What an end says to people. @param {{outcome: string, text: string}} end */
export function endText({ outcome, text }) {
  if (outcome === "arrived") return gettext("The robot is there.");
  if (outcome === "replaced")
    return gettext("The stick took over: the drive to the place has ended.");
  if (outcome === "cancelled") return gettext("The drive to the place was cancelled.");
  return interpolate(gettext("The drive to the place has ended. %s"), [text]);
}

/** "2.4 m left, 12 s". @param {{left_m: ?number, since_s: number, ending: string}} going */
export function goingText({ left_m: left, since_s: since, ending = "" }) {
  if (ending) return gettext("Drives to a place: is being ended");
  const seconds = Math.round(since);
  return left === null || left === undefined
    ? interpolate(gettext("Drives to a place: %s s"), [seconds])
    : interpolate(gettext("Drives to a place: %s m left, %s s"), [left.toFixed(1), seconds]);
}
