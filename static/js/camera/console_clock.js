/** Converts the console's time to this page's time, from the round trips of pings. */

const KEPT = 10;

export class ConsoleClock {
  #trips = [];

  /** A new connection: another web process has another clock. */
  clear() {
    this.#trips = [];
  }

  /**
   * @param {{sent_ms: number, now_ms: number}} pong
   * @param {number} nowMs time of arrival, by this page's clock
   */
  receive({ sent_ms: sentMs, now_ms: consoleMs }, nowMs) {
    const tripMs = nowMs - sentMs;
    this.#trips.push({ tripMs, offsetMs: consoleMs + tripMs / 2 - nowMs });
    if (this.#trips.length > KEPT) this.#trips.shift();
  }

  /** Convert a console time to this page's clock, by the shortest of the last trips; null before any. */
  here(consoleMs) {
    if (this.#trips.length === 0) return null;
    const { offsetMs } = this.#trips.reduce((a, b) => (b.tripMs < a.tripMs ? b : a));
    return consoleMs - offsetMs;
  }
}
