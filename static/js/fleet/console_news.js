/**
 * News of the console about the robots: first all, then those that changed. It says something five times a second,
 * if only `beat`.
 */

import { connectionFact } from "../control/status/status_text.js";
import { mark, setText } from "../lib/dom.js";

const STALE_MS = 500;
const LOOK_MS = 100;

export class ConsoleNews {
  robots = {}; // by slug, as told last
  #socket;
  #connection;
  #follow;
  #heardMs = -Infinity; // time of this connection's last news
  #timer;

  /**
   * @param {import("../connection/socket.js").LiveSocket} socket
   * @param {HTMLElement} connection shows the state of the connection
   * @param {(isStale: boolean) => void} follow hears often whether what the page shows is old
   */
  constructor(socket, connection, follow) {
    this.#socket = socket;
    this.#connection = connection;
    this.#follow = follow;
    socket.addEventListener("message", ({ detail }) => this.#hear(detail));
    socket.addEventListener("open", () => this.#begin());
    socket.addEventListener("down", () => this.#look());
    this.#timer = setInterval(() => this.#look(), LOOK_MS);
    this.#look();
  }

  get isLive() {
    return this.#socket.open && performance.now() - this.#heardMs < STALE_MS;
  }

  close() {
    clearInterval(this.#timer);
  }

  #begin() {
    this.#heardMs = -Infinity;
    this.#look();
  }

  #hear({ t, robots, changed = false }) {
    if (t !== "fleet" && t !== "beat") return;
    if (robots) this.robots = changed ? { ...this.robots, ...robots } : robots;
    this.#heardMs = performance.now();
    this.#look();
  }

  #look() {
    const { level, text } = connectionFact({
      connected: this.#socket.open,
      received: this.#heardMs > -Infinity,
      stale: !this.isLive,
    });
    mark(this.#connection, "level", level);
    setText(this.#connection, text);
    this.#follow(!this.isLive);
  }
}
