/** Remaining time of a lease. The server sends the seconds; this page counts them by its own clock. */

const LAST_CALL_S = 30;

/** @returns {number | null} seconds left at `nowMs`, never below zero; null if `seconds` is not known */
export function remaining(seconds, receivedMs, nowMs) {
  if (seconds === null || seconds === undefined) return null;
  return Math.max(0, seconds - (nowMs - receivedMs) / 1000);
}

/** "4:05", "0:09", "1 h 02 min". */
export function clockText(seconds) {
  const whole = Math.ceil(seconds);
  const two = (n) => String(n).padStart(2, "0");
  if (whole >= 3600)
    return `${Math.floor(whole / 3600)} h ${two(Math.floor((whole % 3600) / 60))} min`;
  return `${Math.floor(whole / 60)}:${two(whole % 60)}`;
}

/** Whole minutes, for times that are not counted down: "40 min", "2 h 05 min". */
export function minutesText(seconds) {
  const minutes = Math.ceil(seconds / 60);
  if (minutes < 60) return `${minutes} min`;
  return `${Math.floor(minutes / 60)} h ${String(minutes % 60).padStart(2, "0")} min`;
}

/** Return the reason why a button does nothing now: the robot or the way to it is silent, or the person has no control. */
export function whyNotNow() {
  return "stale" in document.body.dataset
    ? gettext("No contact: nothing can be asked of the robot now.")
    : gettext("Take control first.");
}

/** Return whether the person should be offered to keep control. */
export function isLastCall(seconds) {
  return seconds !== null && seconds <= LAST_CALL_S;
}
