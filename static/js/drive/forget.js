/** The button by which a holder makes the robot forget what it saw before. */

import { takeControlFirst } from "../control/lease.js";
import { dim } from "../lib/dom.js";
import { question } from "../lib/question.js";

export class Forget {
  #button;
  #question;
  #listening = new AbortController();

  /**
   * @param {HTMLButtonElement} button
   * @param {HTMLDialogElement} dialog in which a person confirms it
   * @param {(request: object) => void} send
   */
  constructor(button, dialog, send) {
    this.#button = button;
    this.#question = question(dialog, () => send({ t: "forget" }));
    dim(button, true, takeControlFirst());
    button.addEventListener("click", () => this.#ask(), { signal: this.#listening.signal });
  }

  /** @param {?boolean} may whether this tab has control; null: not known yet */
  set mayAct(may) {
    dim(this.#button, !may, takeControlFirst());
  }

  close() {
    this.#listening.abort();
    this.#question.close();
  }

  #ask() {
    this.#button.closest("[popover]")?.hidePopover?.(); // the menu would cover the dialog
    this.#question.ask();
  }
}
