/**
 * The gate's verdict in words of a driver: what, where, what to do. The bridge's own sentence is the engineers'
 * detail. Pure.
 */

import { number } from "../../formats/numbers.js";

// Nothing holds the robot back; or a fault, or the stick, has its own reason.
const SILENT = new Set([
  "idle",
  "free",
  "robot_limit",
  "stopped",
  "neutral_needed",
  "robot_offline",
]);
const OBSTACLES = new Set(["obstacle", "near_miss", "mover"]);

/** Return the side of the robot on which something is. @param {string} side as in the verdict */
function sideWords(side) {
  return {
    ahead: gettext("ahead"),
    "ahead left": gettext("ahead on the left"),
    left: gettext("on the left"),
    "behind left": gettext("behind on the left"),
    behind: gettext("behind"),
    "behind right": gettext("behind on the right"),
    right: gettext("on the right"),
    "ahead right": gettext("ahead on the right"),
  }[side];
}

function isZero(twist) {
  return twist.every((value) => value === 0);
}

/**
 * Return why the robot is slow or stands; null: nothing holds it back.
 * @param {object} verdict the newest
 * @returns {import("./faults.js").Reason | null}
 */
export function gateReason(verdict) {
  if (SILENT.has(verdict.code)) return null;
  const stands = isZero(verdict.allowed) && !isZero(verdict.asked);
  const reason = OBSTACLES.has(verdict.code)
    ? obstacle(verdict, stands)
    : { level: "warning", ...ofRule(verdict, stands) };
  if (!reason.title) return { ...reason, title: verdict.text };
  return { ...reason, detail: verdict.text };
}

function obstacle(verdict, stands) {
  const { code, distance_m: gapM, side, sensor, text } = verdict;
  const level = stands ? "warning" : "info";
  const place = [number(Math.max(0, gapM ?? 0), 1), sideWords(side) ?? ""];
  const isRemembered = /remembered/.test(sensor ?? "") || /remembered/.test(text);
  if (code === "mover")
    return {
      level,
      title: interpolate(gettext("Somebody or something moves, %s m %s"), place),
      text: stands ? gettext("Wait until the way is free.") : "",
    };
  if (isRemembered)
    return {
      level,
      title: interpolate(gettext("Something was seen earlier, %s m %s"), place),
      text: stands ? gettext("Look there. If nothing is there, let the robot forget it.") : "",
      act: stands ? "forget" : undefined,
    };
  if (!stands) return { level, title: interpolate(gettext("Slower: something is %s m %s"), place) };
  const isAhead = side?.startsWith("ahead");
  return {
    level,
    title: interpolate(gettext("Something is %s m %s"), place),
    text: isAhead
      ? gettext("The robot stands. Back off, or turn away from it.")
      : gettext("The robot stands. Drive away from it."),
    act: isAhead ? "back_off" : undefined,
  };
}

/** Rules without an obstacle. No title: the bridge's own sentence. */
function ofRule({ code, text }, stands) {
  return RULES[code]?.(stands, text) ?? {};
}

function tellStaff() {
  return gettext("If this lasts, tell staff.");
}

function noDepth(stands, text) {
  if (/head is turning/.test(text)) return { title: gettext("Slower: the head is turning") };
  return {
    title: gettext("The robot cannot see table tops: its depth camera sends no picture"),
    text: stands ? tellStaff() : gettext("The robot drives slowly until it does."),
  };
}

function noLaser() {
  return {
    title: gettext("The laser reports nothing: the robot sees nothing and stands"),
    text: tellStaff(),
  };
}

function noOdometry() {
  return {
    title: gettext("The wheels report nothing: the robot stands"),
    text: tellStaff(),
  };
}

/** Reasons by the rule's code; arguments: whether the robot stands, and the bridge's sentence. */
const RULES = {
  depth_missing: noDepth,
  depth_stale: noDepth,
  scan_missing: noLaser,
  scan_stale: noLaser,
  scan_unpaired: noLaser,
  odometry_missing: noOdometry,
  odometry_stale: noOdometry,
  head_away: () => ({
    title: gettext("The robot’s eyes look away from its way"),
    text: gettext("Let it look where it drives."),
    act: "look",
  }),
  blind_direction: () => ({
    title: gettext("The robot sees nothing on that side"),
    text: gettext("It goes slowly. Look yourself."),
  }),
  behind_unseen: () => ({
    title: gettext("The robot has not looked behind itself"),
    text: gettext("Let it turn and look; or look yourself, then pull again."),
    act: "turn",
  }),
  sonar_stale: () => ({
    title: gettext("A distance sensor reports nothing"),
    text: gettext("The robot drives slowly on that side. If this lasts, tell staff."),
  }),
  robot_late: () => ({
    title: gettext("Slower: the robot answers late"),
    text: gettext("Its network or its computer is busy."),
  }),
  operator_late: () => ({
    title: gettext("Slower: your connection is slow"),
    text: gettext("Go nearer to the network’s antenna, or use a cable."),
  }),
  camera_late: () => ({
    title: gettext("Slower: the camera’s picture comes late"),
    text: gettext("Go nearer to the network’s antenna, or drive by the plan."),
  }),
  scan_late: () => ({ title: gettext("Slower: the laser reports late") }),
  arm_away: () => ({
    title: gettext("Slower: the arm reaches beyond the base"),
    text: gettext("Move the arm home, and the robot may drive faster."),
    act: "arm_home",
  }),
};
