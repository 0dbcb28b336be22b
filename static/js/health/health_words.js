/** Texts about the robot's health. Pure. Names and texts of parts are the robot's own. */

import { minutesText } from "../control/lease.js";
import { whenText } from "../formats/times.js";

export const LOW_BATTERY_PERCENT = 20;

/** How bad a level is; a notice is shown when it rises. */
export const BADNESS = { ok: 0, silent: 1, warning: 2, error: 3 };

/** The mark with which the page shows a level. */
export const MARKS = { ok: "ok", silent: "warn", warning: "warn", error: "fail" };

/** "84 %, about 3 h 30 min left". @param {object} state of the robot */
export function batteryText({ battery_percent: percent, battery_left_min: left = null, charging }) {
  if (percent === null) return "–";
  const text = `${Math.round(percent)} %`;
  if (charging) return interpolate(gettext("%s, charging"), [text]);
  if (left === null) return text;
  return interpolate(gettext("%s, about %s left"), [text, minutesText(60 * left)]);
}

/** "Speakers: Amplifier does not answer". @param {{name: string, level: string, text: string}} part */
export function partText({ name, level, text }) {
  const words = {
    silent: gettext("has stopped reporting"),
    warning: text || gettext("warns, without a reason"),
    error: text || gettext("reports an error, without a reason"),
  };
  return interpolate(gettext("%s: %s"), [name, words[level]]);
}

/**
 * Return since when a part is not well, by the page's clock.
 * @param {{since_s: number}} part
 * @param {number} nowMs
 */
export function sinceText({ since_s: since }, nowMs) {
  return interpolate(gettext("since %s"), [whenText(new Date(nowMs - 1000 * since))]);
}

/** Return the health in one line. @param {?object} health of the state */
export function healthText(health) {
  if (!health) return "–";
  const { parts, parts_more: more, well } = health;
  if (!parts.length)
    return interpolate(ngettext("All well (%s part)", "All well (%s parts)", well), [well]);
  const others = parts.length + more - 1;
  const worst = partText(parts[0]);
  return others ? interpolate(gettext("%s, and %s more"), [worst, others]) : worst;
}

/**
 * Return the same for a card, with the time since when, or the highest temperature.
 * @param {?object} health
 * @param {number} nowMs
 */
export function cardHealth(health, nowMs) {
  const text = healthText(health);
  const [worst] = health?.parts ?? [];
  if (worst) return interpolate(gettext("%s (%s)"), [text, sinceText(worst, nowMs)]);
  const [hottest] = health?.temperatures ?? [];
  return hottest ? interpolate(gettext("%s, at most %s °C"), [text, hottest.celsius]) : text;
}

/**
 * "Motors: left wheel 84 °C, Computer 52 °C"; empty: no temperature is known.
 * @param {object[]} temperatures
 */
export function temperaturesText(temperatures) {
  return temperatures.map(({ name, celsius }) => `${name} ${celsius} °C`).join(", ");
}

/** Return a text about parts and reports that are not listed; empty: none. @param {object} health */
export function leftOutText({ parts_more: more, left_out: leftOut, unread }) {
  const texts = [
    more && interpolate(gettext("%s more parts are not well."), [more]),
    leftOut &&
      interpolate(gettext("At least %s parts, or some of their reporters, are not shown."), [
        leftOut,
      ]),
    unread &&
      interpolate(gettext("%s reports could not be read: no name, or an unknown level."), [unread]),
  ];
  return texts.filter(Boolean).join(" ");
}
