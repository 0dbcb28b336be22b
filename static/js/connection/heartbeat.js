/** Watches that the other end of a socket still answers, and measures the round trip. */

import { RoundTrips } from "./round_trips.js";

const PING_MS = 1000;
const SILENCE_MS = 4000; // then the page connects again

export class Heartbeat {
  #socket;
  #trips = new RoundTrips();
  #unansweredMs = null; // since when a ping waits for any word
  #timer;

  /** @param {import("./socket.js").LiveSocket} socket */
  constructor(socket) {
    this.#socket = socket;
    this.#timer = setInterval(() => this.#beat(), PING_MS);
  }

  /** The middle one of the last round trips, in milliseconds; null before the first. */
  get delayMs() {
    return this.#trips.median;
  }

  /** A new connection. */
  begin() {
    this.#unansweredMs = null;
    this.#trips.clear();
  }

  /** Any message is a sign of life. */
  heard(message) {
    this.#unansweredMs = null;
    if (message.t === "pong") this.#trips.add(performance.now() - message.sent_ms);
  }

  close() {
    clearInterval(this.#timer);
  }

  /** Browsers slow the timers of hidden pages down: silence counts from a ping, not from the last word. */
  #beat() {
    if (!this.#socket.open) return;
    const now = performance.now();
    this.#unansweredMs ??= now;
    if (now - this.#unansweredMs > SILENCE_MS) this.#socket.reset();
    else this.#socket.send({ t: "ping", sent_ms: now });
  }
}
