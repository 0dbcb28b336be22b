/** The button by which a holder turns the robot's head to where the robot drives. */

import { takeControlFirst } from "../control/lease.js";
import { dim, show } from "../lib/dom.js";

export class LookAhead {
  #button;
  #listening = new AbortController();

  /** @param {HTMLButtonElement} button @param {(request: object) => void} send */
  constructor(button, send) {
    this.#button = button;
    dim(button, true, takeControlFirst());
    button.addEventListener("click", () => send({ t: "look_ahead" }), {
      signal: this.#listening.signal,
    });
  }

  /** @param {object} facts the robot's facts: without a head, the button is hidden */
  set facts({ has_head }) {
    show(this.#button, has_head);
  }

  /** @param {?boolean} may whether this tab has control; null: not known yet */
  set mayAct(may) {
    dim(this.#button, !may, takeControlFirst());
  }

  close() {
    this.#listening.abort();
  }
}
