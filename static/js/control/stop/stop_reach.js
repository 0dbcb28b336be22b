/**
 * Whether STOP can reach the robot while a part of the way to it is silent, in words that promise nothing. Pure.
 *
 * Each press is sent by the socket, by HTTP, or both; the console sends it to the robot's bridge and watchdog. Silence
 * on any part of that way leaves open whether it arrives, and only a press finds out.
 */

/** Return the words in the button itself. */
export function reachWord() {
  return gettext("May not arrive");
}

/** Return what to do if a stop does not arrive. A robot that is only silent may still hear. */
export function reachText() {
  return gettext("STOP may not arrive: if the robot moves, press the red button on the robot.");
}

/**
 * Return the engineers' words: the ways that are left to a stop.
 * @param {"page" | "console" | "bridge" | "robot"} who is silent
 */
export function reachDetail(who) {
  return {
    page: gettext(
      "Without the page’s live connection, a stop is sent by HTTP; the page says within 4 s whether it arrived.",
    ),
    console: gettext("A stop is also sent by HTTP; the page says within 4 s whether it arrived."),
    bridge: gettext(
      "A watchdog on the server may take a stop while the bridge is away. Without both, the stop waits until one is back.",
    ),
    robot: gettext(
      "Bridge and watchdog send the stop by connections of their own: the watchdog’s may work when the bridge’s do not.",
    ),
  }[who];
}
