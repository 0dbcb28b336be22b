/** A WebSocket that connects again by itself: JSON in and out, bytes in, as DOM events. */

import { inPageLanguage } from "../formats/sentences.js";
import { waitBefore } from "./backoff.js";

// An attempt that began without a network may wait much longer for its next packet.
const OPEN_WITHIN_MS = 3000;
const SLOW_WITHIN_MS = 10_000;
const QUICK_ATTEMPTS = 4; // after these, the network may just be slow
// Closed for good: signed out, not permitted, no such robot.
export const CLOSED_FOR_GOOD = new Set([4401, 4403, 4404]);

// After this time a connection counts as good: a server that closes it at once, or is silent, does not get so
// far.
const LASTED_MS = 10_000;

/** @param {string} path such as "/ws/fleet/" */
export function socketUrl(path, base = location.href) {
  const url = new URL(path, base);
  url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
  return url.href;
}

/** Take over the socket that `early.js` opened for this address. @returns {?WebSocket} null: there is none */
function earlySocket(url) {
  window.earlySocket ??= null; // from now on it opens none
  const socket = window.earlySocket;
  if (socket?.url !== url) return null;
  window.earlySocket = null;
  return socket.readyState > WebSocket.OPEN ? null : socket;
}

/**
 * Events: "open", "down" (detail: {code}), "message" (detail: the decoded message), "bytes" (detail: an
 * ArrayBuffer). It connects again after every loss until `close()` is called.
 */
export class LiveSocket extends EventTarget {
  #url;
  #longestMs;
  #socket = null;
  #attempt = 0; // failures since a connection lasted LASTED_MS
  #openedMs = Infinity;
  #retry = null;
  #patience = null;
  #closed = false;
  #fresh = 0; // characters sent since the last question for the backlog
  #wake = () => {
    if (!this.open) this.reset(); // the attempt began without a network
    clearTimeout(this.#retry);
    this.connect();
  };

  /** @param {number} [longestMs] between two attempts; for pages that need no answer at once */
  constructor(url, longestMs) {
    super();
    this.#url = url;
    this.#longestMs = longestMs;
    window.addEventListener("online", this.#wake);
  }

  get open() {
    return this.#socket?.readyState === WebSocket.OPEN;
  }

  /**
   * Return how many bytes waited at the last question and still wait. A browser counts what was just sent until
   * the page finds time for a later task: while the page draws, that says nothing about the network.
   */
  takeBacklog() {
    const waiting = (this.#socket?.bufferedAmount ?? 0) - this.#fresh;
    this.#fresh = 0;
    return Math.max(waiting, 0);
  }

  connect() {
    if (this.#closed || this.#socket) return;
    const socket = earlySocket(this.#url) ?? new WebSocket(this.#url);
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    this.#openedMs = Infinity;
    const patienceMs = this.#attempt < QUICK_ATTEMPTS ? OPEN_WITHIN_MS : SLOW_WITHIN_MS;
    this.#patience = setTimeout(() => this.reset(), patienceMs);
    const opened = () => {
      clearTimeout(this.#patience);
      this.#openedMs = performance.now();
      this.#emit("open");
    };
    if (socket.readyState === WebSocket.OPEN) queueMicrotask(opened);
    else socket.addEventListener("open", opened);
    socket.addEventListener("message", ({ data }) =>
      typeof data === "string"
        ? this.#emit("message", inPageLanguage(JSON.parse(data)))
        : this.#emit("bytes", data),
    );
    socket.addEventListener("close", (event) => this.#lost(socket, event.code));
  }

  /** Sends if the connection is open. @returns {boolean} whether it was. */
  send(message) {
    if (!this.open) return false;
    const text = JSON.stringify(message);
    this.#fresh += text.length;
    this.#socket.send(text);
    return true;
  }

  /** Closes a connection that does not answer, and connects again. */
  reset() {
    const socket = this.#socket;
    if (!socket) return;
    this.#lost(socket, 0);
    socket.close();
  }

  close() {
    this.#closed = true;
    window.removeEventListener("online", this.#wake);
    clearTimeout(this.#retry);
    clearTimeout(this.#patience);
    this.#socket?.close();
  }

  #lost(socket, code) {
    if (socket !== this.#socket) return;
    this.#socket = null;
    clearTimeout(this.#patience);
    if (performance.now() - this.#openedMs > LASTED_MS) this.#attempt = 0;
    this.#emit("down", { code });
    if (this.#closed) return;
    clearTimeout(this.#retry);
    const waitMs = waitBefore(this.#attempt, Math.random, this.#longestMs);
    this.#retry = setTimeout(() => this.connect(), waitMs);
    this.#attempt += 1;
  }

  #emit(type, detail = null) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}
