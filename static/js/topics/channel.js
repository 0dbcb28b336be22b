/** The connection for the robot's topics: requests with one answer each, and live views. */

import { Heartbeat } from "../connection/heartbeat.js";
import { LiveSocket } from "../connection/socket.js";
import { PATIENCE_MS as LATE_MS } from "../tasks/tasks.js";

// The program that answers may have to start first, and the robot's own services need time.
const PATIENCE_MS = 12_000;

/** A refusal, as an error. */
class RefusedError extends Error {
  /** @param {{code: string, text: string, figures?: object}} refusal */
  constructor(refusal) {
    super(refusal.text);
    this.refusal = refusal;
  }
}

/**
 * Events: "open", "refused" (detail: a refusal without a request), "late" (the first answer that is late).
 * Open only while the topics tab is shown.
 */
export class TopicsChannel extends EventTarget {
  #url;
  #socket = null;
  #heartbeat = null;
  #listening = null; // aborted by close(), so that messages of a closed socket are ignored
  #seq = 0;
  #asked = new Map();
  #subscriptions = new Map();

  /** @param {string} url of the WebSocket */
  constructor(url) {
    super();
    this.#url = url;
  }

  open() {
    if (this.#socket) return;
    this.#socket = new LiveSocket(this.#url);
    this.#heartbeat = new Heartbeat(this.#socket);
    this.#listening = new AbortController();
    const { signal } = this.#listening;
    this.#socket.addEventListener("open", () => this.#opened(), { signal });
    this.#socket.addEventListener("down", () => this.#lost(), { signal });
    this.#socket.addEventListener("message", ({ detail }) => this.#receive(detail), { signal });
    document.addEventListener("visibilitychange", () => this.#followVisibility(), { signal });
    this.#socket.connect();
  }

  close() {
    if (!this.#socket) return;
    this.#listening.abort();
    this.#heartbeat.close();
    this.#socket.close();
    this.#socket = null;
    this.#lost();
  }

  /**
   * @param {object} question without its number.
   * @returns {Promise<object>} the answer; rejects with a RefusedError.
   */
  ask(question) {
    this.#seq += 1;
    const seq = this.#seq;
    return new Promise((resolve, reject) => {
      const fail = (code, text) => {
        this.#forget(seq);
        reject(new RefusedError({ code, text }));
      };
      const late = setTimeout(() => this.#late(seq), LATE_MS);
      const over = setTimeout(
        () => fail("no_answer", gettext("No answer came. Try again.")),
        PATIENCE_MS,
      );
      this.#asked.set(seq, { resolve, reject, fail, timers: [late, over], isLate: false });
      if (!this.#socket?.send({ ...question, seq })) {
        fail("not_connected", gettext("There is no connection to the server."));
      }
    });
  }

  /** Subscribes to a topic until `unsubscribe`. Each topic has at most one subscription. */
  subscribe(topic, rateHz, show) {
    this.#subscriptions.set(topic, { rateHz, show });
    this.#socket?.send({ t: "subscribe", topic, rate_hz: rateHz });
  }

  /** Subscribe if the page is visible; end the subscriptions if it is hidden. */
  #followVisibility() {
    for (const [topic, { rateHz }] of this.#subscriptions) {
      this.#socket.send(
        document.hidden ? { t: "unsubscribe", topic } : { t: "subscribe", topic, rate_hz: rateHz },
      );
    }
  }

  unsubscribe(topic) {
    if (this.#subscriptions.delete(topic)) this.#socket?.send({ t: "unsubscribe", topic });
  }

  #opened() {
    this.#heartbeat.begin();
    if (!document.hidden) this.#followVisibility();
    this.dispatchEvent(new CustomEvent("open"));
  }

  #lost() {
    const text = gettext("The connection was lost.");
    for (const { fail } of [...this.#asked.values()]) fail("not_connected", text);
  }

  #late(seq) {
    const isFirst = [...this.#asked.values()].every(({ isLate }) => !isLate);
    this.#asked.get(seq).isLate = true;
    if (isFirst) this.dispatchEvent(new CustomEvent("late"));
  }

  #forget(seq) {
    for (const timer of this.#asked.get(seq)?.timers ?? []) clearTimeout(timer);
    this.#asked.delete(seq);
  }

  #receive(message) {
    this.#heartbeat.receive(message);
    if (message.t === "sample") {
      this.#subscriptions.get(message.topic)?.show(message);
      requestAnimationFrame(() => this.#socket?.send({ t: "ack" }));
    } else if (this.#asked.has(message.seq)) {
      const { resolve, reject } = this.#asked.get(message.seq);
      this.#forget(message.seq);
      if (message.t === "refused") reject(new RefusedError(message.refusal));
      else resolve(message);
    } else if (message.t === "refused") {
      this.dispatchEvent(new CustomEvent("refused", { detail: message.refusal }));
    }
  }
}
