/** A WebSocket that comes back: JSON in and out, as DOM events. */

import { waitBefore } from "./backoff.js";

/** @param {string} path such as "/ws/fleet/" */
export function socketUrl(path, base = location.href) {
  const url = new URL(path, base);
  url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
  return url.href;
}

/**
 * Events: "open", "down" (detail: {code}), "message" (detail: the decoded message).
 * It connects again after every loss until `close()` is called.
 */
export class LiveSocket extends EventTarget {
  #url;
  #socket = null;
  #attempt = 0;
  #retry = null;
  #closed = false;
  #wake = () => {
    clearTimeout(this.#retry);
    this.connect();
  };

  constructor(url) {
    super();
    this.#url = url;
    window.addEventListener("online", this.#wake);
  }

  get open() {
    return this.#socket?.readyState === WebSocket.OPEN;
  }

  /** Bytes that the network has not taken yet. */
  get backlog() {
    return this.#socket?.bufferedAmount ?? 0;
  }

  connect() {
    if (this.#closed || this.#socket) return;
    const socket = new WebSocket(this.#url);
    this.#socket = socket;
    socket.addEventListener("open", () => {
      this.#attempt = 0;
      this.#tell("open");
    });
    socket.addEventListener("message", (event) => this.#tell("message", JSON.parse(event.data)));
    socket.addEventListener("close", (event) => this.#lost(socket, event.code));
  }

  /** Sends if the connection is open. @returns {boolean} whether it was. */
  send(message) {
    if (!this.open) return false;
    this.#socket.send(JSON.stringify(message));
    return true;
  }

  /** Gives a connection up that no longer answers, and connects anew. */
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
    this.#socket?.close();
  }

  #lost(socket, code) {
    if (socket !== this.#socket) return;
    this.#socket = null;
    this.#tell("down", { code });
    if (this.#closed) return;
    clearTimeout(this.#retry);
    this.#retry = setTimeout(() => this.connect(), waitBefore(this.#attempt));
    this.#attempt += 1;
  }

  #tell(type, detail = null) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}
