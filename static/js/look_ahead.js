/** The button by which a holder sends the robot's head to where the robot drives. */

import { show } from "./dom.js";

export class LookAhead {
  #button;
  #listening = new AbortController();

  /** @param {HTMLButtonElement} button @param {(order: object) => void} send */
  constructor(button, send) {
    this.#button = button;
    button.disabled = true;
    button.addEventListener("click", () => send({ t: "look_ahead" }), {
      signal: this.#listening.signal,
    });
  }

  /** @param {object} facts the robot's facts: one without a head offers nothing */
  set facts({ has_head }) {
    show(this.#button, has_head);
  }

  /** @param {?number} fence of this tab's control; null: it has none */
  set fence(fence) {
    this.#button.disabled = fence === null;
  }

  close() {
    this.#listening.abort();
  }
}
