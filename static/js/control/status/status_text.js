/** Texts about the state of connection, robot, stop and gate. Pure. */

import { number } from "../../formats/numbers.js";
import { whenText } from "../../formats/times.js";

const LOST_MS = 3000;

/** Return whether the silence counts as a lost connection: requests make no sense now. */
export function isLost(sinceViewMs) {
  return sinceViewMs > LOST_MS;
}

/**
 * Return the state of a page's connection: an open but silent connection counts as none.
 * @param {object} now
 * @param {boolean} now.connected the page has its socket
 * @param {object | null} [now.gone] refusal: no link from the console to the robot's bridge
 * @param {boolean} now.received a state was received
 * @param {boolean} now.stale the newest state is too old
 */
export function connectionFact({ connected, gone = null, received, stale }) {
  if (!connected) return { level: "fail", text: gettext("Offline") };
  if (gone) return { level: "fail", text: gettext("No link") };
  if (!received) return { level: "warn", text: gettext("Connecting") };
  return stale
    ? { level: "fail", text: gettext("No news") }
    : { level: "ok", text: gettext("Connected") };
}

const SEEN_S = 2; // a robot that is silent for longer is out of reach

/** Return whether the robot itself reported recently; otherwise its motion is not known. */
export function isSeen({ phase, unseen_s: unseenS }) {
  return phase === "online" || (unseenS ?? Infinity) < SEEN_S;
}

/** Text for a robot that is out of reach. @param {?number} seenAt seconds since 1970 */
export function unknownText(seenAt) {
  if (!seenAt) return gettext("unknown");
  return interpolate(gettext("unknown, last seen %s"), [whenText(seenAt * 1000)]);
}

/** Return the time of a robot's last report, from its state. @returns {?number} seconds since 1970 */
export function seenAt({ unseen_s: unseenS }, nowMs = Date.now()) {
  return unseenS === null || unseenS === undefined ? null : nowMs / 1000 - unseenS;
}

/** Return a warning about a robot that moves although it is stopped; empty if there is none. */
export function movesTitle({ moves_although_stopped: moves = null }) {
  if (!moves) return "";
  return moves.parts.includes("base") && moves.speed_mps === null
    ? gettext(
        "The robot moved although it is stopped, and nobody knows whether it still moves: press its red button",
      )
    : gettext("The robot moves although it is stopped: press its red button");
}

/** Return the same with the causes that the console knows. */
export function movesText({ moves_although_stopped: moves, stop }) {
  const by = stop.by ? interpolate(gettext("Stopped by %s."), [stop.by]) : "";
  return [moves.text, by, gettext("This page cannot stop it.")].filter(Boolean).join(" ");
}

/** Return a text about the standstill, from the bridge's report. */
export function standstillText(stop) {
  if (stop.state === "stopping")
    return gettext("The robot is being stopped; standstill is not confirmed yet.");
  if (stop.was_standing) return gettext("The robot was standing.");
  if (stop.standstill_ms === null || stop.standstill_ms === undefined) return "";
  return interpolate(gettext("Standstill confirmed after %s ms."), [
    Math.round(stop.standstill_ms),
  ]);
}

/** Return the same in few words, for the stop button itself; empty while the latch is clear. */
export function stopText(state) {
  const { stop } = state;
  if (stop.state === "clear") return "";
  if (state.moves_although_stopped) return gettext("It moves!");
  if (!isSeen(state) || state.stands === null) return gettext("Pressed");
  if (stop.state === "stopping") return gettext("Stopping");
  if (stop.was_standing) return gettext("Stopped, was standing");
  if (!standstillText(stop)) return gettext("Stopped");
  return interpolate(gettext("Standstill after %s\u00a0ms"), [Math.round(stop.standstill_ms)]);
}

/** Return which part of the console was late, and how late; empty if none was. */
export function overloadText({ overload = null }) {
  if (!overload) return "";
  const text =
    overload.part === "bridge"
      ? gettext("The robot’s bridge was %s s late.")
      : gettext("The server was %s s late.");
  return interpolate(text, [number(overload.late_s, 1)]);
}

/** Warning if only the bridge receives stops, without watchdog; otherwise empty. */
export function watchdogText({ watchdog_missing: missing = false }) {
  return missing
    ? gettext(
        "A stop depends on one program alone, the robot’s bridge: if that fails, the stop waits until it is back. The watchdog is missing.",
      )
    : "";
}

/**
 * Return a text about the pending stop and its author; empty if there is none.
 * @param {?object} pending by, reason, at
 */
export function pendingText(pending) {
  if (!pending) return "";
  const text = gettext("A stop by %s, %s, waits for the robot and is delivered when it is back.");
  return interpolate(text, [pending.by, whenText(pending.at * 1000)]);
}

export function phaseTitle(phase) {
  const titles = {
    waiting: gettext("Waiting for the robot"),
    connecting: gettext("The robot is not ready"),
    refused: gettext("The bridge cannot join the robot"),
    online: gettext("Online"),
  };
  return titles[phase] ?? phase;
}

/**
 * Return whether the gate stops the stick completely. Not while a drive is being recorded, which takes only a
 * moment.
 */
export function isHeld(verdict) {
  const zero = (twist) => twist.every((value) => value === 0);
  return verdict.code !== "recording" && !zero(verdict.asked) && zero(verdict.allowed);
}
