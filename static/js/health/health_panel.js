/**
 * The robot's health on the control page: in the header if a part is not well, always in Details, and as a
 * notice when it gets worse.
 */

import { fill, mark, setText, setTextOrHide, show } from "../lib/dom.js";
import {
  BADNESS,
  batteryText,
  healthText,
  LOW_BATTERY_PERCENT,
  leftOutText,
  MARKS,
  partText,
  sinceText,
  temperaturesText,
} from "./health_words.js";

const AGAIN_MS = 60_000; // a part that changes again and again gets one notice a minute
const LATE_MS = 12_000; // the silence of a part counts from its last report, 10 s before

export class HealthPanel {
  #parts;
  #notify;
  #notified = null; // by part: its badness, and the time of the notice; null: no report yet
  #beganMs; // time of the first report
  #low = null;

  /** @param {object} parts of the page @param {(notice: object) => void} notify adds a notice */
  constructor(parts, notify) {
    this.#parts = parts;
    this.#notify = notify;
  }

  /** @param {object} state of the robot @param {boolean} cut the state may be out of date */
  show(state, cut, nowMs = Date.now()) {
    const { health = null } = state;
    this.#showBattery(state);
    this.#showHeader(cut ? null : health);
    if (cut) return; // `since_s` counts from the report: the time would be wrong for an old state
    this.#showDetails(health, nowMs);
    if (health) this.#notifyOfParts(health.parts, health.parts_more, nowMs);
    this.#notifyOfBattery(state);
  }

  #showBattery(state) {
    const { battery_percent: percent } = state;
    const { battery, "battery-percent": short } = this.#parts;
    setText(battery, batteryText(state));
    setText(short, batteryText({ battery_percent: percent }));
    for (const part of [battery, short])
      mark(part, "low", percent !== null && percent < LOW_BATTERY_PERCENT);
  }

  #showHeader(health) {
    const opener = this.#parts["health-open"];
    show(opener, health !== null && health.level !== "ok");
    mark(opener, "level", MARKS[health?.level ?? "ok"]);
    opener.title = healthText(health);
  }

  #showDetails(health, nowMs) {
    const {
      "health-line": line,
      "health-parts": list,
      temperatures,
      "health-more": more,
    } = this.#parts;
    const ill = health?.parts ?? [];
    setTextOrHide(line, health === null ? gettext("No node of the robot reports.") : "");
    if (health && !ill.length) setTextOrHide(line, healthText(health));
    fill(
      list,
      ill.map((part) => `${partText(part)} (${sinceText(part, nowMs)})`),
    );
    for (const [i, part] of ill.entries()) mark(list.children[i], "level", MARKS[part.level]);
    const hot = temperaturesText(health?.temperatures ?? []);
    setTextOrHide(temperatures, hot && interpolate(gettext("Temperatures: %s"), [hot]));
    setTextOrHide(more, health ? leftOutText(health) : "");
  }

  #notifyOfParts(parts, more, nowMs) {
    this.#beganMs ??= nowMs;
    const before = this.#notified ?? new Map();
    const now = new Map();
    for (const part of parts) {
      const changedMs = nowMs - 1000 * part.since_s;
      const old = {
        badness: 0,
        notifiedBadness: 0,
        notifiedMs: -AGAIN_MS,
        ...before.get(part.name),
      };
      if (changedMs > (old.leftMs ?? Infinity) - LATE_MS) old.badness = 0; // perhaps it was well in between
      const badness = BADNESS[part.level];
      const isNews = badness > old.notifiedBadness || nowMs - old.notifiedMs >= AGAIN_MS;
      // The list is limited. A part that appears only now may have been faulty before this page was opened.
      const isFresh = before.has(part.name) || changedMs > this.#beganMs - LATE_MS;
      const notifies = this.#notified !== null && badness > old.badness && isNews && isFresh;
      if (notifies) {
        const level = part.level === "error" ? "error" : "warning";
        this.#notify({ level, code: `health ${part.name}`, text: partText(part) });
      }
      now.set(part.name, {
        badness,
        notifiedBadness: notifies || this.#notified === null ? badness : old.notifiedBadness,
        notifiedMs: notifies ? nowMs : old.notifiedMs,
      });
    }
    // A part may be missing because the list is full. A part that is well again is kept for a minute: it may
    // fail again.
    for (const [name, old] of before) {
      if (now.has(name)) continue;
      if (more > 0) now.set(name, { leftMs: nowMs, ...old });
      else if (nowMs - old.notifiedMs < AGAIN_MS) now.set(name, { ...old, badness: 0 });
    }
    this.#notified = now;
  }

  #notifyOfBattery({ battery_percent: percent, charging }) {
    if (percent === null) return;
    const low = percent < LOW_BATTERY_PERCENT && !charging;
    if (low && this.#low === false) {
      const text = interpolate(gettext("The battery is low: %s %."), [Math.round(percent)]);
      this.#notify({ level: "warning", code: "battery", text });
    }
    this.#low = low || (this.#low === true && percent < LOW_BATTERY_PERCENT + 2);
  }
}
