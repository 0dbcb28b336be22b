/** What this page asks of the robot besides driving: each order has a number, one answer, and is told about once. */

const PATIENCE_MS = 750;

export class Orders {
  #send;
  #notices;
  #fence = null;
  #seq = 0;
  #waiting = new Map(); // by number

  /**
   * @param {(message: object) => boolean} send false if there is no connection
   * @param {{add: (notice: object) => void}} notices
   */
  constructor(send, notices) {
    this.#send = send;
    this.#notices = notices;
  }

  /** @param {?number} fence of this tab's control; null: it has none */
  set fence(fence) {
    this.#fence = fence;
  }

  get fence() {
    return this.#fence;
  }

  /**
   * @param {object} order without its number; `fence` is added where this tab has control
   * @param {string} what it is, for notices: "Play wave"
   * @returns {Promise<?object>} the refusal, or null once it is accepted
   */
  send(order, what = order.t) {
    this.#seq += 1;
    const seq = this.#seq;
    const message =
      this.#fence === null ? { ...order, seq } : { fence: this.#fence, ...order, seq };
    if (!this.#send(message)) {
      const refusal = {
        code: "not_connected",
        text: gettext("There is no connection to the console."),
      };
      this.#say("error", what, refusal.text);
      return Promise.resolve(refusal);
    }
    return new Promise((resolve) => {
      const timer = setTimeout(() => {
        this.#say("warning", what, gettext("No answer yet. It may still be carried out."));
      }, PATIENCE_MS);
      this.#waiting.set(seq, { resolve, timer, what });
    });
  }

  /** @param {object} answer `accepted` or `refused`. @returns {boolean} whether it belongs to an order of this page */
  heard({ t, seq, refusal }) {
    const waiting = this.#waiting.get(seq);
    if (!waiting) return false;
    clearTimeout(waiting.timer);
    this.#waiting.delete(seq);
    if (t === "refused") this.#say("warning", waiting.what, refusal.text);
    waiting.resolve(t === "refused" ? refusal : null);
    return true;
  }

  /** The connection is lost: what was not answered is not known. */
  lost() {
    const text = gettext("The connection was lost before the answer came.");
    for (const { resolve, timer, what } of this.#waiting.values()) {
      clearTimeout(timer);
      this.#say("error", what, text);
      resolve({ code: "not_connected", text });
    }
    this.#waiting.clear();
  }

  #say(level, what, text) {
    this.#notices.add({ level, code: `${what} ${text}`, text: `${what}: ${text}` });
  }
}
