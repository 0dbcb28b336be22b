/** Keeps the newest message about the robot, and its age. Times are in milliseconds of the page. */

import { isLost, seenAt } from "./status/status_text.js";

const BACK_WITHIN_MS = 1000; // views come again when the page is shown again

export class RobotContact {
  #state = null; // the newest
  #stateMs = -Infinity; // time at which it was received
  #gone = null; // refusal: no link from the console to the robot's bridge
  #pending = null; // stop that waits until the link is back
  #seen = null; // time of the robot's last report, in seconds since 1970
  // When the page was last hidden: a hidden page gets no views, which does not count as silence.
  #hiddenMs = -Infinity;

  get state() {
    return this.#state;
  }

  /** @param {object} state of the robot, from a `view` */
  receive(state, nowMs) {
    this.#gone = null;
    this.#state = state;
    this.#seen = seenAt(state) ?? this.#seen;
    this.#stateMs = nowMs;
  }

  /** The console has lost the robot's bridge. @param {object} message `bridge_gone` */
  lose({ refusal, stop, seen_at: seen }) {
    this.#gone = refusal;
    this.#pending = stop;
    this.#seen = seen ?? this.#seen;
  }

  /** The page is hidden, or was until now. */
  hide(nowMs) {
    this.#hiddenMs = nowMs;
  }

  /** Return whether no view may have come only because the page was hidden. */
  wasHidden(nowMs) {
    return this.#hiddenMs > this.#stateMs && nowMs - this.#hiddenMs < BACK_WITHIN_MS;
  }

  /** Return whether the robot has reported a stop since this time. */
  isStoppedSince(sinceMs) {
    return this.#stateMs > sinceMs && this.#state.stop.state !== "clear";
  }

  /** Return whether the robot is out of reach: there is no link, or no view came for some seconds. */
  isLost(nowMs) {
    const sinceMs = nowMs - Math.max(this.#stateMs, this.#hiddenMs);
    return this.#gone !== null || (this.#state !== null && isLost(sinceMs));
  }

  /** Return the facts that the banner and the status bar need. */
  facts(nowMs) {
    return {
      gone: this.#gone,
      pending: this.#pending,
      seen: this.#seen,
      state: this.#state,
      sinceViewMs: nowMs - this.#stateMs,
    };
  }
}
