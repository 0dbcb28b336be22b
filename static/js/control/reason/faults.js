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
import { reachDetail, reachText } from "../stop/stop_reach.js";
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
 * @property {string} [code] of an alarm
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
  if (silence && (silence.who !== "robot" || !state))
    return [...moved(state), ...pendingStop(now), silent(now)];
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
      title: gettext("The server is overloaded"),
      text: gettext("Commands may come late, and then the robot stops. Tell staff."),
      detail: overloadText(state),
    });
  }
  if (state.watchdog_missing) {
    found.push({
      level: "info",
      title: gettext("A safety program is missing: keep the red button in reach"),
      text: gettext("Tell staff: the server’s log says why."),
      detail: watchdogText(state),
    });
  }
  return found;
}

/** A stop that a person pressed, and that nobody has confirmed. @param {string} text why @returns {Reason} */
export function unconfirmedStop(text) {
  return {
    level: "alarm",
    code: "stop",
    title: gettext("Your stop is not confirmed: press the red button on the robot"),
    text,
    act: "dismiss",
  };
}

/** A stop waits for the robot. @returns {Reason[]} */
function pendingStop({ gone, pending }) {
  if (!gone || !pending) return [];
  return [
    {
      level: "alarm",
      code: "stop_pending",
      title: gettext("A stop is not confirmed: press the red button on the robot"),
      text: pendingText(pending),
    },
  ];
}

function silent({ silence, gone, seen }) {
  const { who } = silence;
  const goesOn = gettext("This page connects again by itself. If it lasts, tell staff.");
  const fault = {
    level: "fault",
    text: reachText(),
    detail: sentences(reachDetail(who), gone?.text, who === "bridge" && lastSeen(seen), goesOn),
  };
  if (who === "page")
    return {
      ...fault,
      title: gettext("No connection to the server"),
      text: sentences(fault.text, gettext("Connecting again.")),
    };
  if (who === "bridge")
    return {
      ...fault,
      title: gettext("No link to the robot"),
      text: sentences(fault.text, whatIsSeen()),
    };
  return {
    ...fault,
    title: sinceText(
      silence,
      gettext("The server does not answer"),
      gettext("The server has not answered for %s"),
    ),
    text: sentences(fault.text, whatIsSeen()),
  };
}

/** The robot's computer, its network or its wheels' sensors: the bridge waits for odometry. */
function robotSilent({ silence, state, seen }) {
  const goesOn = gettext("This page connects again by itself. If it lasts, tell staff.");
  const fault = {
    level: "fault",
    text: reachText(),
    detail: sentences(state.text, lastSeen(seenAt(state) ?? seen), reachDetail("robot"), goesOn),
  };
  if (state.phase === "refused")
    return { ...fault, title: gettext("The server cannot join the robot") };
  if (state.phase === "connecting") return { ...fault, title: gettext("The robot is not ready") };
  if (state.phase === "waiting")
    return {
      ...fault,
      title: gettext("The robot is out of reach"),
      text: sentences(fault.text, gettext("Is it switched on?")),
    };
  return {
    ...fault,
    title: sinceText(
      silence,
      gettext("The robot does not answer"),
      gettext("The robot has not answered for %s"),
    ),
    text: sentences(fault.text, whatIsSeen()),
  };
}

function moves(state) {
  return {
    level: "alarm",
    code: "moves_although_stopped",
    title:
      state.stands === null
        ? movesTitle(state)
        : gettext("It moves although stopped: press the red button on the robot"),
    text: gettext("This page cannot stop it."),
    detail: movesText(state),
  };
}

/** While the page has no news: the robot moved although it was stopped. @returns {Reason[]} */
function moved(state) {
  if (!state?.moves_although_stopped) return [];
  return [
    {
      level: "alarm",
      code: "moves_although_stopped",
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

/** The robot is stopped, but its odometry is silent: an alarm, unless it has been seen to stand since the stop. */
function stoppedUnseen(state) {
  const { stop } = state;
  const isUnknown = stop.state === "stopping" && (!isSeen(state) || state.stands === null);
  const title = stop.by
    ? interpolate(gettext("Stop by %s: nobody knows whether the robot stands"), [stop.by])
    : gettext("Stop: nobody knows whether the robot stands");
  return {
    level: isUnknown ? "alarm" : "stop",
    code: "stop_unseen",
    title,
    text: sentences(stop.reason, gettext("If it moves, press its red button.")),
    detail: interpolate(gettext("Standstill: %s."), [unknownText(seenAt(state))]),
  };
}

function whatIsSeen() {
  return gettext("What you see is old.");
}

function sentences(...texts) {
  return texts.filter(Boolean).join(" ");
}

function lastSeen(at) {
  return at ? interpolate(gettext("State of the robot: %s."), [unknownText(at)]) : "";
}
