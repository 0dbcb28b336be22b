/** Faults that keep a person from driving, each with its words and what the person can do. Pure. */

import {
  isSeen,
  movesText,
  movesTitle,
  overloadText,
  pendingText,
  seenAt,
  standstillText,
  unknownText,
  watchdogText,
} from "../status/status_text.js";
import { sinceText } from "./silence.js";

/**
 * Why the robot does not do what the person wants, or may not do it soon.
 *
 * @typedef {object} Reason
 * @property {"alarm" | "fault" | "stop" | "warning" | "info"} level gives its colour
 * @property {string} title what is wrong, and where
 * @property {string} [text] what to do
 * @property {string} [act] the button that does it: a name of `ReasonStrip`
 * @property {string} [detail] the engineers' words
 */

/**
 * Return the faults at this moment, the worst first.
 * @param {object} now as `silenceOf` takes it, and:
 * @param {boolean} now.outdated the page has another version than the console, and can only stop
 * @param {?object} now.silence as of `silenceOf`
 * @param {?object} now.pending the stop that waits for the robot, while there is no link
 * @param {?number} now.seen time of the robot's last report, in seconds since 1970
 * @param {boolean} now.mayClear this person may clear a stop
 * @returns {Reason[]}
 */
export function faultsOf(now) {
  const { outdated, silence, state, mayClear } = now;
  if (outdated)
    return [
      {
        level: "fault",
        title: gettext("This page is of another version"),
        text: gettext("Load it again. Until then it can only stop the robot."),
        act: "reload",
      },
    ];
  if (silence && (silence.who !== "robot" || !state)) return [silent(now), ...moved(state)];
  if (!state) return [{ level: "info", title: gettext("Looking for the robot") }];
  const act = mayClear ? "clear" : undefined;
  const found = [];
  if (state.moves_although_stopped) found.push(moves(state));
  if (state.stop.state !== "clear") found.push({ ...stopped(state, silence), act });
  if (silence) found.push(robotSilent(now));
  if (state.navigation_held) {
    found.push({
      level: "warning",
      title: gettext("The robot is held"),
      text: state.navigation_held,
    });
  }
  return found;
}

/** Return what staff should know although the person can drive. @returns {Reason[]} */
export function warningsOf(state) {
  const found = [];
  if (state.overload) {
    found.push({
      level: "info",
      title: gettext("The console’s computer is overloaded"),
      text: gettext("Commands may come late, and then the robot stops. Tell staff."),
      detail: overloadText(state),
    });
  }
  if (state.watchdog_missing) {
    found.push({
      level: "info",
      title: gettext("A safety program is missing: keep the red button in reach"),
      text: gettext("Tell staff: the console’s log says why."),
      detail: watchdogText(state),
    });
  }
  return found;
}

function silent({ silence, gone, pending, seen }) {
  if (silence.who === "page")
    return {
      level: "fault",
      title: gettext("No connection to the console"),
      text: gettext(
        "The robot stands still. This page connects again by itself: check this device’s network.",
      ),
    };
  if (silence.who === "bridge")
    return {
      level: "fault",
      title: gettext("No link to the robot"),
      text: sentences(
        pendingText(pending),
        gettext("This page connects again by itself. If it lasts, tell staff."),
      ),
      detail: sentences(gone.text, lastSeen(seen)),
    };
  return {
    level: "fault",
    title: sinceText(
      silence,
      gettext("The console is silent"),
      gettext("The console has been silent for %s"),
    ),
    text: gettext(
      "The picture is old, and commands may not arrive. This page connects again by itself.",
    ),
  };
}

/** The robot's computer, its network or its wheels' sensors: the bridge waits for odometry. */
function robotSilent({ silence, state, seen }) {
  const detail = sentences(state.text, lastSeen(seenAt(state) ?? seen));
  const goesOn = gettext("This page connects again by itself. If it lasts, tell staff.");
  if (state.phase === "refused")
    return {
      level: "fault",
      title: gettext("The console cannot join the robot"),
      text: goesOn,
      detail,
    };
  if (state.phase === "connecting")
    return { level: "fault", title: gettext("The robot is not ready"), text: goesOn, detail };
  if (state.phase === "waiting")
    return {
      level: "fault",
      title: gettext("The robot is out of reach"),
      text: sentences(gettext("Is it switched on, and in the network?"), goesOn),
      detail,
    };
  return {
    level: "fault",
    title: sinceText(
      silence,
      gettext("The robot is silent"),
      gettext("The robot has been silent for %s"),
    ),
    text: gettext(
      "What you see is old. It gets no commands; if it still moves, press the red button on the robot.",
    ),
    detail,
  };
}

function moves(state) {
  return {
    level: "alarm",
    title:
      state.stands === null
        ? movesTitle(state)
        : gettext("It moves although stopped: press the red button on the robot"),
    text: gettext("The console cannot stop it."),
    detail: movesText(state),
  };
}

/** While the page has no news: the robot moved although it was stopped. @returns {Reason[]} */
function moved(state) {
  if (!state?.moves_although_stopped) return [];
  return [
    {
      level: "alarm",
      title: gettext("The robot moved although it is stopped: press its red button."),
    },
  ];
}

function stopped(state, silence) {
  const { stop } = state;
  if (silence || !isSeen(state) || state.stands === null) return stoppedUnseen(state);
  const isStopping = stop.state === "stopping";
  const anonymous = isStopping ? gettext("Stopping, pressed") : gettext("Stopped");
  const signed = isStopping ? gettext("Stopping, pressed by %s") : gettext("Stopped by %s");
  return {
    level: "stop",
    title: stop.by ? interpolate(signed, [stop.by]) : anonymous,
    text: sentences(stop.reason, standstillText(stop)),
  };
}

/** The robot is stopped, but its odometry is silent. */
function stoppedUnseen(state) {
  const { stop } = state;
  const title = stop.by
    ? interpolate(gettext("Stop by %s: nobody knows whether the robot stands"), [stop.by])
    : gettext("Stop: nobody knows whether the robot stands");
  return {
    level: "stop",
    title,
    text: sentences(stop.reason, gettext("If it moves, press its red button.")),
    detail: interpolate(gettext("Standstill: %s."), [unknownText(seenAt(state))]),
  };
}

function sentences(...texts) {
  return texts.filter(Boolean).join(" ");
}

function lastSeen(at) {
  return at ? interpolate(gettext("State of the robot: %s."), [unknownText(at)]) : "";
}
