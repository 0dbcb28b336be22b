/** Time of the console as time of this page, by the round trips of pings. */

const KEPT = 10;

export class ConsoleClock {
  #trips = [];

  /** A new connection: another web process has another clock. */
  clear() {
    this.#trips = [];
  }

  /** @param {{sent_ms: number, now_ms: number}} pong @param {number} nowMs when it came, by this page's clock */
  heard({ sent_ms: sentMs, now_ms: consoleMs }, nowMs) {
    const tripMs = nowMs - sentMs;
    this.#trips.push({ tripMs, offsetMs: consoleMs + tripMs / 2 - nowMs });
    if (this.#trips.length > KEPT) this.#trips.shift();
  }

  /** The console's time by this page's clock, by the shortest of the last round trips; null before the first. */
  here(consoleMs) {
    if (this.#trips.length === 0) return null;
    const { offsetMs } = this.#trips.reduce((a, b) => (b.tripMs < a.tripMs ? b : a));
    return consoleMs - offsetMs;
  }
}
