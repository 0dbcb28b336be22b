/** Tasks for the robot except driving: each has a number, one answer, and one notice. */

import { whyNotNow } from "../control/lease.js";

export const PATIENCE_MS = 750;
const HICCUP_MS = 1000; // after a shorter silence a request arrives while the person still expects its effect
// After this time an answer is ignored: the person does not expect it any more.
export const FORGOTTEN_MS = 15_000;

/**
 * A kind of request.
 *
 * @typedef {object} RequestKind
 * @property {(request: object) => string} name in words
 * @property {(request: object) => string} [done] text for an accepted request; without it the robot reports
 *   the end later
 * @property {"optional" | "none"} [control] optional: the console checks who may send it without control;
 *   none: it does not concern control. Without it, control is needed.
 * @property {number} [patienceMs] an answer is late after this time
 * @property {boolean} [ends] it ends something: it is sent also while the robot, or the way to it, is silent
 */

/** The beginning of a text, on one line. */
export function shortened(text, length = 40) {
  const line = text.replace(/\s+/g, " ").trim();
  const letters = Array.from(line);
  return letters.length <= length ? line : `${letters.slice(0, length - 1).join("")}…`;
}

/**
 * Sends requests with the fence of this tab's control, matches answers to requests by their number, and shows
 * notices about them.
 */
export class TaskRequests {
  #send;
  #notify;
  #seq;
  #kinds;
  #fence = null;
  #silentSinceMs = Infinity; // the robot, or the way to it
  #waiting = new Map();

  /**
   * @param {(message: object) => boolean} send returns whether there was a connection
   * @param {(notice: {level: string, code: string, text: string}) => void} notify
   * @param {number} first the last used number: a reload of the tab does not set it back
   * @param {Object<string, RequestKind>} kinds by their `t`
   */
  constructor(send, notify, first, kinds) {
    this.#send = send;
    this.#notify = notify;
    this.#seq = first;
    this.#kinds = kinds;
  }

  /** @param {?number} fence of this tab's control; null: it has none */
  set fence(fence) {
    this.#fence = fence;
  }

  /** @param {boolean} stale a request would come late: the robot would move when nobody expects it any more */
  set stale(stale) {
    this.#silentSinceMs = stale ? performance.now() : Infinity;
  }

  /**
   * @param {object} request without its number and fence. `title` is for people and is not sent; `quiet`:
   *   only refusals are reported, for requests that a page repeats.
   * @returns {Promise<?object>} the refusal; null if it was accepted
   */
  send(request) {
    const { control, ends } = this.#kinds[request.t];
    const code = this.#whyNot(ends);
    if (code && !control)
      return Promise.resolve(this.#refused(request, { code, text: whyNotNow() }));
    const { title, quiet, ...message } = request;
    this.#seq += 1;
    message.seq = this.#seq;
    if (this.#fence !== null && control !== "none") message.fence = this.#fence;
    if (!this.#send(message)) {
      const text = gettext("There is no connection to the server: nothing was sent.");
      return Promise.resolve(this.#refused(request, { code: "not_connected", text }));
    }
    return new Promise((resolve) => {
      const { patienceMs = PATIENCE_MS } = this.#kinds[request.t];
      const late = setTimeout(() => this.#late(message.seq), patienceMs);
      const forgotten = setTimeout(() => this.#waiting.delete(message.seq), FORGOTTEN_MS);
      this.#waiting.set(message.seq, { request, resolve, timers: [late, forgotten] });
    });
  }

  /** @returns {boolean} whether the message was the answer to a request */
  receive({ t, of, seq, refusal }) {
    const waiting = this.#waiting.get(seq);
    if ((t !== "accepted" && t !== "refused") || waiting?.request.t !== of) return false;
    this.#forget(seq);
    waiting.resolve(
      t === "accepted" ? this.#done(waiting.request) : this.#refused(waiting.request, refusal),
    );
    return true;
  }

  /** The connection is lost: no answers will come. */
  lost() {
    const text = gettext("The connection was lost before an answer came.");
    for (const [seq, { request, resolve, isLate }] of this.#waiting) {
      this.#forget(seq);
      if (!isLate) resolve(this.#refused(request, { code: "no_answer", text }));
    }
  }

  close() {
    for (const seq of this.#waiting.keys()) this.#forget(seq);
  }

  /** @returns {string} code of the reason why nothing that needs control is sent now; empty: it is */
  #whyNot(ends) {
    if (this.#fence === null) return "no_lease";
    const isLate = performance.now() - this.#silentSinceMs > HICCUP_MS;
    return isLate && !ends ? "robot_silent" : "";
  }

  #forget(seq) {
    for (const timer of this.#waiting.get(seq).timers) clearTimeout(timer);
    this.#waiting.delete(seq);
  }

  #done(request) {
    const text = this.#kinds[request.t].done?.(request);
    if (text && !request.quiet) this.#notify({ level: "success", code: text, text });
    return null;
  }

  #refused(request, refusal) {
    const what = this.#kinds[request.t].name(request); // two refused motions are two notices, also if the reason is the same
    const code = `${what} ${refusal.code}`;
    this.#notify({ level: "warning", code, text: `${what}: ${refusal.text}` });
    return refusal;
  }

  #late(seq) {
    const waiting = this.#waiting.get(seq);
    waiting.isLate = true; // reported as late here: it is reported again only if its answer comes
    const text = gettext("no answer within 0.75 s. Look what the robot does before you try again.");
    waiting.resolve(this.#refused(waiting.request, { code: "no_answer", text }));
  }
}
