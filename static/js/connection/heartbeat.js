/** Checks that the other end of a socket still answers, and measures the round trip. */

import { RoundTrips } from "./round_trips.js";

const PING_MS = 1000;
const SILENCE_MS = 4000; // then the page connects again

export class Heartbeat {
  #socket;
  #trips = new RoundTrips();
  #unansweredMs = null; // time of the first ping after the last message
  #timer;

  /** @param {import("./socket.js").LiveSocket} socket */
  constructor(socket) {
    this.#socket = socket;
    this.#timer = setInterval(() => this.#beat(), PING_MS);
  }

  /** The median of the last round trips, in milliseconds; null before the first. */
  get delayMs() {
    return this.#trips.median;
  }

  /** Begin with a new connection. */
  begin() {
    this.#unansweredMs = null;
    this.#trips.clear();
  }

  /** Take a message of any kind: it shows that the other end answers. */
  receive(message) {
    this.#unansweredMs = null;
    if (message.t === "pong") this.#trips.add(performance.now() - message.sent_ms);
  }

  close() {
    clearInterval(this.#timer);
  }

  /** Ping. Silence counts from a ping, not from the last message: timers of hidden pages are slow. */
  #beat() {
    if (!this.#socket.open) return;
    const now = performance.now();
    this.#unansweredMs ??= now;
    if (now - this.#unansweredMs > SILENCE_MS) this.#socket.reset();
    else this.#socket.send({ t: "ping", sent_ms: now });
  }
}
