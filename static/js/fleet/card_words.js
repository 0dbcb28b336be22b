/** Texts about a robot on the fleet page and on the lab's monitor. Pure. */

import { minutesText } from "../control/lease.js";
import { gateReason } from "../control/reason/gate_words.js";
import { silenceOf, silenceText } from "../control/reason/silence.js";
import {
  isSeen,
  movesTitle,
  pendingText,
  phaseTitle,
  seenAt,
  standstillText,
  unknownText,
} from "../control/status/status_text.js";
import { number } from "../formats/numbers.js";
import { batteryText, cardHealth, MARKS } from "../health/health_words.js";
import { movingText } from "../limbs/words.js";
import { shortened } from "../tasks/tasks.js";

const MOVES_MPS = 0.02;
const TURNS_RADPS = 0.05;
const GAP_S = 60; // a shorter time between two bookings does not count as free

/** Return the texts of a robot's card: its state, or the refusal if the state is not known. Pure. */
export function cardOf({
  state,
  refusal,
  seen_at: seenByConsole = null,
  pending = null,
  out = null,
}) {
  if (!state) {
    const unknown = unknownText(seenByConsole);
    const silent = refusal?.code === "bridge_silent";
    return {
      old: true,
      level: out ? "warn" : "fail",
      status: out ? outOfService() : silent ? gettext("No news") : gettext("No link"),
      why: (out ?? refusal)?.text ?? "",
      doing: silent ? gettext("It sends no data") : gettext("Out of reach"),
      driver: "–",
      recorded: "",
      battery: "–",
      health: "–",
      healthLevel: "ok",
      gate: unknown,
      stop: pending ? gettext("Pending") : unknown,
      stopped: false,
      stopWhy: pendingText(pending),
      alarm: "",
    };
  }
  const online = state.phase === "online";
  const fit = online && !state.watchdog_missing && !out;
  const silence = silenceOf({ connected: true, state, sinceViewMs: 0 });
  const { stop } = state;
  const latched = stop.state !== "clear";
  const silent = latched && state.stands === null;
  const unknown = isSeen(state) && !silent ? "" : unknownText(seenByConsole ?? seenAt(state));
  const alarm = movesTitle(state);
  const standstill = alarm
    ? ""
    : unknown
      ? interpolate(gettext("Standstill: %s"), [unknown])
      : standstillText(stop);
  return {
    old: silence !== null,
    level: alarm || (online && silence) ? "fail" : fit ? "ok" : "warn",
    status:
      online && silence ? silenceText(silence) : out ? outOfService() : phaseTitle(state.phase),
    why: [
      alarm && state.moves_although_stopped.text,
      out?.text,
      online ? "" : state.text,
      state.watchdog_missing ? watchdogMissing() : "",
    ]
      .filter(Boolean)
      .join(" "),
    doing: alarm || unknown || doingText(state),
    driver: state.holder ?? gettext("Nobody"),
    recorded:
      !unknown && state.recorded_by ? interpolate(gettext("%s records"), [state.recorded_by]) : "",
    battery: unknown ? "–" : batteryText(state),
    health: unknown ? "–" : cardHealth(state.health ?? null, Date.now()),
    healthLevel: unknown ? "ok" : MARKS[state.health?.level ?? "ok"],
    gate: unknown || gateReason(state.verdict)?.title || gettext("Nothing slows it down"),
    stop: alarm ? gettext("Stopped, but it moves") : stopWord(stop.state, unknown),
    stopped: latched,
    alarm,
    stopWhy: latched
      ? [stop.by && interpolate(gettext("by %s"), [stop.by]), standstill].filter(Boolean).join(". ")
      : "",
  };
}

/** Return a text about the current booking, the next booking and the next free time. Pure. */
export function bookingWords({
  booked = null,
  next_booked: next = null,
  free_in_s: freeInS = 0,
  out = null,
}) {
  if (out) return freeInS === null ? "–" : freeIn(freeInS);
  const name = (one) => (one.mine ? gettext("You") : one.name);
  if (booked) {
    const left = minutesText(booked.seconds);
    if (!next || next.seconds >= booked.seconds + GAP_S)
      return interpolate(gettext("%s, %s left, then free"), [name(booked), left]);
    const words = interpolate(gettext("%s, %s left, then %s"), [name(booked), left, name(next)]);
    const free = freeInS === null ? gettext("booked for a day") : freeIn(freeInS);
    return `${words}; ${free}`;
  }
  if (next) return interpolate(gettext("Free, %s in %s"), [name(next), minutesText(next.seconds)]);
  return gettext("Free");
}

/** Return whose turn it is in a lesson, and who is next; empty if no lesson with turns runs. Pure. */
export function turnWords({ booked = null }) {
  const turn = booked?.turn;
  if (!turn) return "";
  const words = [];
  if (turn.person && turn.driving)
    words.push(
      interpolate(gettext("%s drives, %s left"), [turn.person, minutesText(turn.seconds)]),
    );
  else if (turn.person) words.push(interpolate(gettext("%s, it is your turn"), [turn.person]));
  if (turn.next) words.push(interpolate(gettext("next: %s"), [turn.next]));
  return words.join(" · ");
}

function freeIn(seconds) {
  return interpolate(gettext("free in %s"), [minutesText(seconds)]);
}

function outOfService() {
  return gettext("Out of service");
}

function watchdogMissing() {
  return gettext("A safety program is missing: a stop depends on one program alone. Tell staff.");
}

function stopWord(state, unknown) {
  if (state === "clear") return unknown || gettext("Not pressed");
  if (unknown) return gettext("Pressed");
  return state === "stopping" ? gettext("Stopping") : gettext("Stopped");
}

/** Return the words for the robot's current action. Pure. @param {object} state of the robot */
export function doingText(state) {
  const alarm = movesTitle(state);
  if (alarm) return alarm;
  const { stop, motion, speech, drive_by: driveBy, going, holder, charging } = state;
  if (stop.state === "stopping") return gettext("Is being stopped");
  if (stop.state === "stopped") return gettext("Stopped");
  if (state.phase !== "online") return phaseTitle(state.phase);
  if (motion) return interpolate(gettext("Moves its arm: %s"), [motion.name.replaceAll("_", " ")]);
  const moves = movingText(state.limbs);
  if (moves) return moves;
  if (going?.place) return interpolate(gettext("Drives to “%s”, for %s"), [going.place, going.who]);
  if (going) return interpolate(gettext("Drives to a place, for %s"), [going.who]);
  if (driveBy) return interpolate(gettext("Drives by itself, for %s"), [driveBy.who]);
  if (speech) return interpolate(gettext("Says “%s”"), [shortened(speech.text)]);
  const drives = drivingText(state.odometry);
  if (drives) return drives;
  if (holder) return interpolate(gettext("Stands, %s has control"), [holder]);
  return charging ? gettext("Charges") : gettext("Stands, nobody has control");
}

function drivingText(odometry) {
  if (!odometry) return "";
  const speed = Math.hypot(odometry.vx, odometry.vy);
  if (speed > MOVES_MPS) {
    const text =
      odometry.vx < -MOVES_MPS ? gettext("Reverses at %s m/s") : gettext("Drives at %s m/s");
    return interpolate(text, [number(speed, 1)]);
  }
  return Math.abs(odometry.w) > TURNS_RADPS ? gettext("Turns on the spot") : "";
}
