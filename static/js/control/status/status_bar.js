/** Status of connection and robot on the control page: header, banner, gate, stop. */

import { HealthPanel } from "../../health/health_panel.js";
import { Announcer } from "../../lib/announce.js";
import { fill, mark, setText, show } from "../../lib/dom.js";
import { SAID_MS } from "../stop/stop_button.js";
import { banner } from "./banner.js";
import { Details } from "./details.js";
import { brief, namesOf, plain } from "./plain_words.js";
import { Reasons } from "./reasons.js";
import { connectionFact, isStale, limitsOf, stopText, verdictText } from "./status_text.js";

const STILL = [0, 0, 0];

export class StatusBar {
  #root;
  #parts;
  #details;
  #health;
  #notify;
  #announcer;
  #reasons = new Reasons();
  #names = new Map(); // plain names of sensors, by technical names
  #bannerTitle = "";
  #stopSaid = { text: "", untilMs: 0 };
  #alarm = "";

  /**
   * @param {HTMLElement} root gets the state of the robot's stop for the style sheet
   * @param {(notice: object) => void} notify
   */
  constructor(root, parts, notify) {
    this.#root = root;
    this.#parts = parts;
    this.#details = new Details(parts);
    this.#health = new HealthPanel(parts, notify);
    this.#notify = notify;
    this.#announcer = new Announcer(parts.live);
  }

  /**
   * @param {object} now as `banner` takes it, and:
   * @param {boolean} now.cut the data about the robot may be out of date
   * @param {boolean} now.mayClear this person may clear the stop
   * @param {number | null} now.delayMs time from the page to the console and back
   * @param {number | null} now.echoMs time from the page to the robot's bridge and back
   */
  show(now) {
    const shown = banner(now);
    this.#showBanner(shown, now.mayClear);
    this.#showConnection(now);
    if (now.state) this.#showRobot(now.state, now.cut, shown?.reason);
  }

  set facts(robot) {
    this.#names = namesOf(robot.sonars);
    this.#details.facts = robot;
  }

  /** Show the progress of a pressed stop, until the robot itself reports it. */
  stopSays(text) {
    this.#stopSaid = { text, untilMs: performance.now() + SAID_MS };
    setText(this.#parts["stop-state"], text);
  }

  /** @param {boolean} asks whether the text asks for a sign of the hand: loud, because the input ends soon */
  hint(text, asks = false) {
    setText(this.#parts.hint, text);
    mark(this.#parts.hint, "asks", asks);
  }

  close() {
    this.#announcer.close();
  }

  /** Show the banner. A screen reader reads an alarm at once, and again if its title changes. */
  #showBanner(shown, mayClear) {
    const alarm = shown?.level === "alarm" ? shown.title : "";
    if (alarm && alarm !== this.#alarm) {
      const text = `${shown.title}. ${shown.text}`;
      this.#notify({ level: "error", code: "moves_although_stopped", text, quiet: true });
    }
    this.#alarm = alarm;
    const { banner: box, "banner-title": title, "banner-text": text, clear } = this.#parts;
    show(box, shown !== null);
    if (!shown) this.#announcer.forget(this.#bannerTitle);
    this.#bannerTitle = shown?.title ?? "";
    if (!shown) return;
    mark(box, "level", shown.level);
    setText(title, shown.title);
    setText(text, shown.text);
    show(clear, Boolean(shown.clear && mayClear));
    if (shown.level === "alarm") return; // read at once
    this.#announcer.announce(`${shown.title}. ${shown.text}`, shown.title);
  }

  #showConnection(now) {
    const { connection, delay, echo } = this.#parts;
    const { level, text } = connectionFact({
      ...now,
      received: now.state !== null,
      stale: isStale(now.sinceViewMs),
    });
    mark(connection, "level", level);
    setText(connection, text);
    setText(delay, milliseconds(now.connected ? now.delayMs : null));
    setText(echo, milliseconds(now.echoMs));
  }

  #showRobot(state, cut, neutralNeeded) {
    mark(this.#root, "stop", state.stop.state);
    // The robot's own report replaces it.
    if (state.stop.state !== "clear" && !cut) this.#stopSaid.untilMs = 0;
    const said = performance.now() < this.#stopSaid.untilMs ? this.#stopSaid.text : "";
    setText(this.#parts["stop-state"], said || (cut ? "" : stopText(state)));
    this.#health.show(state, cut);
    this.#showGate(state.verdict, cut, neutralNeeded);
    this.#details.state = state;
  }

  /** Show the speed limits, and the reason why the robot is slow or stands: the gate's, or the banner's. */
  #showGate(verdict, cut, neutralNeeded) {
    const { words, limits } = this.#parts;
    const speedLimits = cut ? [] : limitsOf(verdict);
    const texts = speedLimits.map(({ text }) => brief(text, this.#names));
    fill(limits, texts);
    for (const [i, { holds }] of speedLimits.entries()) mark(limits.children[i], "held", holds);
    const why = neutralNeeded?.text ?? verdictText(verdict);
    const text = cut ? "" : plain(why, this.#names);
    const now = performance.now();
    this.#reasons.add(neutralNeeded ? { ...neutralNeeded, allowed: STILL } : verdict, text, now);
    const shown = brief(text || (cut ? "" : this.#reasons.recent(now)));
    const once = speedLimits.some(({ holds }) => holds) || texts.includes(shown);
    setText(words, once ? "" : shown); // the limits above already show it
    mark(words, "past", !text);
    this.#details.reasons = this.#reasons.list;
    if (!text || neutralNeeded) return; // the banner is read
    this.#announcer.announce(brief(text), `${verdict.code} ${verdict.side}`);
  }
}

function milliseconds(value) {
  return value === null ? "– ms" : `${Math.max(1, Math.round(value))} ms`;
}
