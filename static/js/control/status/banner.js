/** The banner: a text about the worst fault that keeps a person from driving. Pure. */

import {
  isSeen,
  isStale,
  movesText,
  movesTitle,
  overloadText,
  pendingText,
  phaseTitle,
  seenAt,
  standstillText,
  unknownText,
  watchdogText,
} from "./status_text.js";

/**
 * Return the banner: title, text and level, which gives its colour; null: there is no fault.
 * @param {object} now
 * @param {boolean} now.outdated the page has another version than the console, and can only stop
 * @param {boolean} now.connected the page has its socket
 * @param {object | null} now.gone refusal: no link from the console to the robot's bridge
 * @param {?object} now.pending the stop that waits for the robot, while there is no link
 * @param {?number} now.seen time of the robot's last report, in seconds since 1970
 * @param {object | null} now.state the robot's newest `State`
 * @param {number} now.sinceViewMs age of that state
 * @param {boolean} now.asksNeutral this page has control, and its stick must return to the middle first;
 *   shown if nothing else keeps the robot from driving
 * @returns {{level: string, title: string, text: string, clear?: boolean, reason?: ?object} | null} level: alarm,
 *   fault, stop, warning, console, watchdog, info; reason: why the stick must return to the middle
 */
export function banner({
  outdated,
  connected,
  gone,
  pending,
  seen,
  state,
  sinceViewMs,
  asksNeutral,
}) {
  if (outdated) {
    return {
      level: "fault",
      title: gettext("This page is of another version"),
      text: gettext("Reload it."),
    };
  }
  const moved = movedText(state);
  if (!connected) {
    return {
      level: "fault",
      title: gettext("No connection"),
      text: sentences(
        moved,
        gettext(
          "Connecting again by itself. A robot that you drive stands still until then. If this lasts, check this device’s network.",
        ),
      ),
    };
  }
  if (gone) {
    return {
      level: "fault",
      title: gettext("No link to the robot"),
      text: sentences(moved, pendingText(pending), gone.text, lastSeen(seen), waits()),
    };
  }
  if (!state) return { level: "info", title: gettext("Looking for the robot"), text: "" };
  if (isStale(sinceViewMs)) {
    const seconds = (sinceViewMs / 1000).toFixed(0);
    return {
      level: "warning",
      title: interpolate(gettext("No news for %s s"), [seconds]),
      text: sentences(
        moved,
        gettext("The picture is old, and the robot may not receive your commands."),
        waits(),
      ),
    };
  }
  if (state.moves_although_stopped) {
    return { level: "alarm", title: movesTitle(state), text: movesText(state), clear: true };
  }
  if (state.stop.state !== "clear") return stopBanner(state);
  if (state.phase !== "online") {
    const text = sentences(state.text, isSeen(state) ? "" : lastSeen(seenAt(state)), waits());
    return { level: "warning", title: phaseTitle(state.phase), text };
  }
  if (state.navigation_held) {
    return {
      level: "warning",
      title: gettext("The robot is held"),
      text: state.navigation_held,
    };
  }
  if (asksNeutral && !state.motion) {
    return {
      level: "info",
      title: gettext("Let the stick return to the middle"),
      text: because(state.neutral_needed?.text),
      reason: state.neutral_needed,
    };
  }
  if (state.overload) {
    return {
      level: "console",
      title: gettext("The console’s computer is overloaded"),
      text: `${overloadText(state)} ${gettext("Commands may come late, and then the robot stops. Tell staff.")}`,
    };
  }
  if (state.watchdog_missing) {
    return {
      level: "watchdog",
      title: gettext("A safety program is missing: keep the red button in reach"),
      text: `${watchdogText(state)} ${gettext("Tell staff: the console’s log says why.")}`,
    };
  }
  return null;
}

function stopBanner(state) {
  const { stop } = state;
  if (!isSeen(state) || state.stands === null) return unknownBanner(state);
  const standstill = standstillText(stop);
  const isStopping = stop.state === "stopping";
  const anonymous = isStopping ? gettext("Stopping, pressed") : gettext("Stopped");
  const signed = isStopping ? gettext("Stopping, pressed by %s") : gettext("Stopped by %s");
  return {
    level: "stop",
    title: stop.by ? interpolate(signed, [stop.by]) : anonymous,
    text: [stop.reason, standstill].filter(Boolean).join(" "),
    clear: true,
  };
}

/** The robot is stopped, but its odometry is silent. */
function unknownBanner(state) {
  const { stop } = state;
  const title = stop.by
    ? interpolate(gettext("Stop by %s: nobody knows whether the robot stands"), [stop.by])
    : gettext("Stop: nobody knows whether the robot stands");
  const standstill = interpolate(gettext("Standstill: %s."), [unknownText(seenAt(state))]);
  const advice = gettext("If it moves, press its red button.");
  return { level: "stop", title, text: sentences(stop.reason, standstill, advice), clear: true };
}

/** Return a warning while the page has no news: the robot moved although it was stopped. */
function movedText(state) {
  return state?.moves_although_stopped
    ? gettext("The robot moved although it is stopped: press its red button.")
    : "";
}

function sentences(...texts) {
  return texts.filter(Boolean).join(" ");
}

function lastSeen(at) {
  return at ? interpolate(gettext("State of the robot: %s."), [unknownText(at)]) : "";
}

/** Return the advice for a robot that is out of reach. */
function waits() {
  return gettext("This page continues by itself. If this lasts, tell staff.");
}

function because(reason) {
  if (!reason) return "";
  return `${reason.charAt(0).toUpperCase()}${reason.slice(1)}.`.replace("..", ".");
}
