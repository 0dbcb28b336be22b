/** Requests of a person about control and the stop: each result is reported once. */

import { FORGOTTEN_MS, PATIENCE_MS } from "../tasks/tasks.js";
import { clockText } from "./lease.js";
import { isInLesson } from "./status/control_words.js";

/** The kinds of messages that are requests, each with its name. */
function labels() {
  return {
    take: gettext("Take control"),
    take_over: gettext("Take over"),
    renew: gettext("More time"),
    release: gettext("Release"),
    hand_over: gettext("Hand over"),
    ask: gettext("Ask for control"),
    ask_cancel: gettext("Leave the line"),
    clear: gettext("Clear stop"),
  };
}

/** @param {string} t kind of a message for the server */
export function isControlRequest(t) {
  return t in labels();
}

const SPREAD_S = 0.2; // between rounded reports of the same lease

/** Text for success; empty if the console sends the text. */
function doneText(t, { holder, remaining_s: remainingS }) {
  const texts = {
    take: gettext("You have control."),
    take_over: gettext("You have control."),
    renew: interpolate(gettext("You keep control: %s left."), [clockText(remainingS ?? 0)]),
    release: gettext("You released control."),
    ask: holder
      ? interpolate(gettext("You wait in line. %s knows that you ask for control."), [holder])
      : gettext("You wait in line."),
    ask_cancel: gettext("You have left the line."),
    clear: gettext("The stop is cleared."),
  };
  return texts[t] ?? "";
}

/** Return whether the current `control` answers the request. */
function isDone(t, { state, asking = null, lesson = null, remaining_s: remainingS = 0 }, renewedS) {
  switch (t) {
    case "take":
    case "take_over":
      return state === "yours";
    case "renew":
      return state === "yours" && remainingS > renewedS;
    case "release":
    case "hand_over":
      return state !== "yours";
    case "ask":
      return asking !== null || isInLesson(lesson);
    case "ask_cancel":
      return asking === null && !isInLesson(lesson);
    default:
      return false;
  }
}

export class ControlRequests {
  #send;
  #notify;
  #waiting = new Map(); // by kind of request: timers, and whether it was reported as late
  #remainedS = 0; // of the lease, at the last report of control
  #receivedMs = 0; // time of that report

  /**
   * @param {(message: object) => boolean} send returns whether there was a connection
   * @param {(notice: {level: string, code: string, text: string}) => void} notify
   */
  constructor(send, notify) {
    this.#send = send;
    this.#notify = notify;
  }

  /**
   * @param {object} message for the server, which answers by `control`, by the robot's state or by a refusal
   */
  send(message) {
    const { t } = message;
    this.#forget(t);
    if (!this.#send(message)) {
      this.#failed(t, "not_connected", gettext("There is no connection to the server."));
      return;
    }
    const late = setTimeout(() => this.#late(t), PATIENCE_MS);
    const forgotten = setTimeout(() => this.#forget(t), FORGOTTEN_MS);
    this.#waiting.set(t, { timers: [late, forgotten], isLate: false });
  }

  /** @param {object} control as the server reports it @returns {boolean} whether it completed a request */
  receive(control) {
    const now = performance.now();
    const sinceS = (now - this.#receivedMs) / 1000;
    // The remaining time of a lease gets shorter; a longer time shows a renewal, perhaps reported late.
    const renewedS = this.#remainedS - Math.max(SPREAD_S, sinceS / 2);
    const done = [...this.#waiting.keys()].filter((t) => isDone(t, control, renewedS));
    this.#remainedS = control.remaining_s ?? 0;
    this.#receivedMs = now;
    for (const t of done) this.done(t, control);
    return done.length > 0;
  }

  /** Report success, if it was requested. */
  done(t, control = {}) {
    if (!this.#forget(t)) return;
    const text = doneText(t, control);
    // Panel and banner show it.
    if (text) this.#notify({ level: "success", code: `${t} done`, text, quiet: true });
  }

  refused(t, { code, text }) {
    this.#forget(t);
    this.#failed(t, code, text);
  }

  /** The connection is lost: no answers will come. */
  lost() {
    const text = gettext("The connection was lost before an answer came.");
    for (const [t, { isLate }] of [...this.#waiting]) {
      this.#forget(t);
      if (!isLate) this.#failed(t, "no_answer", text);
    }
  }

  close() {
    for (const t of [...this.#waiting.keys()]) this.#forget(t);
  }

  #late(t) {
    this.#waiting.get(t).isLate = true;
    this.#failed(t, "no_answer", gettext("no answer within 0.75 s. It may still come."));
  }

  #failed(t, code, text) {
    this.#notify({ level: "warning", code: `${t} ${code}`, text: `${labels()[t]}: ${text}` });
  }

  #forget(t) {
    for (const timer of this.#waiting.get(t)?.timers ?? []) clearTimeout(timer);
    return this.#waiting.delete(t);
  }
}
