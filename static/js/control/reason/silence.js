/** Which part of the way from this page to the robot is silent, and for how long. Pure. */

import { ageText } from "../../formats/ages.js";

const SILENT_MS = 400;
const SAID_MS = 1000; // a shorter silence has no figure

/**
 * @param {object} now
 * @param {boolean} now.connected the page has its socket
 * @param {object | null} now.gone refusal: no link from the console to the robot's bridge
 * @param {object | null} now.state the robot's newest `State`
 * @param {number} now.sinceViewMs age of that state
 * @param {number | null} now.delayMs time from the page to the console and back: news come no faster
 * @returns {{who: "page" | "bridge" | "console" | "robot", forMs: ?number} | null} null: all of them report;
 *   `forMs` null: not known
 */
export function silenceOf({ connected, gone = null, state, sinceViewMs, delayMs = null }) {
  const forMs = Number.isFinite(sinceViewMs) ? sinceViewMs : null;
  if (!connected) return { who: "page", forMs };
  if (gone) return { who: "bridge", forMs };
  if (!state) return null; // it has not begun
  if (sinceViewMs > SILENT_MS + (delayMs ?? 0)) return { who: "console", forMs };
  const { phase, unseen_s: unseenS } = state;
  const isKnown = unseenS !== null && unseenS !== undefined;
  if (phase === "online" && !(isKnown && 1000 * unseenS >= SILENT_MS)) return null;
  return { who: "robot", forMs: isKnown ? 1000 * unseenS + sinceViewMs : null };
}

/** Return the same for the header: "Robot: no answer, 4 s". @param {ReturnType<typeof silenceOf>} silence */
export function silenceText({ who, forMs }) {
  const text = {
    page: gettext("Offline"),
    bridge: gettext("No link"),
    console: gettext("Server: no answer"),
    robot: gettext("Robot: no answer"),
  }[who];
  return forMs === null || forMs < SAID_MS ? text : `${text}, ${ageText(forMs)}`;
}

/** Return a title with the age of the silence, once it has one. @param {string} title @param {string} since with %s */
export function sinceText({ forMs }, title, since) {
  return forMs === null || forMs < SAID_MS ? title : interpolate(since, [ageText(forMs)]);
}
