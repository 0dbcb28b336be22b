/** Status of connection and robot on the control page: header, the place for the reason, stop, details. */

import { HealthPanel } from "../../health/health_panel.js";
import { mark, setText } from "../../lib/dom.js";
import { gateReason } from "../reason/gate_words.js";
import { Interventions } from "../reason/interventions.js";
import { reasonsOf } from "../reason/reasons.js";
import { silenceText } from "../reason/silence.js";
import { ReasonStrip } from "../reason/strip.js";
import { SAID_MS } from "../stop/stop_button.js";
import { reachWord } from "../stop/stop_reach.js";
import { Details } from "./details.js";
import { connectionFact, stopText } from "./status_text.js";

const WISHED_MS = 6000;
const ENDED_MS = 60_000;

export class StatusBar {
  #root;
  #parts;
  #details;
  #health;
  #strip;
  #interventions = new Interventions();
  #stopSaid = { text: "", untilMs: 0 };
  #unconfirmed = ""; // why nobody has confirmed the stop that this person pressed
  #wish = { reason: null, untilMs: 0 };
  #ended = { reason: null, untilMs: 0 };

  /**
   * @param {HTMLElement} root gets the state of the robot's stop for the style sheet
   * @param {Record<string, () => void>} acts what the button beside the reason does, by its name
   * @param {(notice: object) => void} notify
   */
  constructor(root, parts, acts, notify) {
    this.#root = root;
    this.#parts = parts;
    this.#details = new Details(parts);
    this.#health = new HealthPanel(parts, notify);
    this.#strip = new ReasonStrip(
      parts,
      { ...acts, dismiss: () => this.#dismiss(), reload: () => location.reload() },
      notify,
    );
  }

  /**
   * @param {object} now as `reasonsOf` takes it, and:
   * @param {number | null} now.delayMs time from the page to the console and back
   * @param {number | null} now.echoMs time from the page to the robot's bridge and back
   * @returns {import("../reason/faults.js").Reason | undefined} the most important reason
   */
  show(now) {
    const nowMs = performance.now();
    const { state, silence } = now;
    const held = state && !silence ? gateReason(state.verdict) : null;
    if (held) this.#interventions.add(state.verdict, held, nowMs);
    if (state?.going || state?.drive_by) this.#ended.untilMs = 0; // the robot tries again
    // The robot's own report of a stop replaces what its button said.
    if (state && !silence && state.stop.state !== "clear") this.#stopArrived();
    const whole = {
      ...now,
      unconfirmed: this.#unconfirmed,
      wish: nowMs < this.#wish.untilMs ? this.#wish.reason : null,
      ended: nowMs < this.#ended.untilMs ? this.#ended.reason : null,
      recent: this.#interventions.recent(nowMs),
    };
    const reasons = reasonsOf(whole);
    this.#strip.show(reasons);
    this.#details.now = reasons;
    this.#details.interventions = this.#interventions.list;
    this.#showConnection(now);
    setText(this.#parts["stop-state"], this.#stopWords(now));
    if (state) this.#showRobot(state, silence);
    return reasons[0];
  }

  set facts(robot) {
    this.#details.facts = robot;
  }

  /** Show the progress of a pressed stop, until the robot itself reports it. */
  stopSays(text) {
    this.#stopSaid = { text, untilMs: performance.now() + SAID_MS };
    this.#unconfirmed = "";
    setText(this.#parts["stop-state"], text);
  }

  /** The pressed stop is not confirmed. @param {string} text why, and the remedy */
  stopFailed(text) {
    this.stopSays(gettext("Not confirmed"));
    this.#unconfirmed = text;
  }

  /** The person tried to drive without control. @param {import("../reason/faults.js").Reason} reason why not */
  wished(reason) {
    this.#wish = { reason, untilMs: performance.now() + WISHED_MS };
  }

  /** The person has control now. */
  granted() {
    this.#wish.untilMs = 0;
  }

  /**
   * A task failed: its reason stays until the person has read it, for a minute, or until the robot drives again.
   * @param {{text: string, detail: string}} notice of its end
   */
  ended({ text, detail }) {
    const reason = { level: "warning", title: text, act: "dismiss", detail };
    this.#ended = { reason, untilMs: performance.now() + ENDED_MS };
  }

  close() {
    this.#strip.close();
  }

  /** The person has read the reason that waits for it. */
  #dismiss() {
    if (this.#unconfirmed) this.#unconfirmed = "";
    else this.#ended.untilMs = 0;
  }

  #stopArrived() {
    this.#stopSaid.untilMs = 0;
    this.#unconfirmed = "";
  }

  /** Words in the stop's button: of the press, of the way that is silent, of the robot. */
  #stopWords({ state, silence }) {
    if (performance.now() < this.#stopSaid.untilMs) return this.#stopSaid.text;
    if (silence && (silence.who !== "robot" || state.stop.state === "clear")) return reachWord();
    return state ? stopText(state) : "";
  }

  #showConnection({ connected, silence, state, delayMs, echoMs }) {
    const { connection, delay, echo } = this.#parts;
    const { level, text } = silence
      ? { level: "fail", text: silenceText(silence) }
      : connectionFact({ connected, received: state !== null, stale: false });
    mark(connection, "level", level);
    setText(connection, text);
    setText(delay, milliseconds(connected && !silence ? delayMs : null));
    setText(echo, milliseconds(silence ? null : echoMs));
  }

  #showRobot(state, silence) {
    mark(this.#root, "stop", state.stop.state);
    this.#health.show(state, Boolean(silence));
    this.#details.state = state;
  }
}

function milliseconds(value) {
  return value === null ? "– ms" : `${Math.max(1, Math.round(value))} ms`;
}
