/** The button by which a holder makes the robot forget what it saw before. */

import { whyNotNow } from "../control/lease.js";
import { dim } from "../lib/dom.js";
import { question } from "../lib/question.js";

export class Forget {
  static hears = ["mayAct"];
  static requests = {
    forget: {
      name: () => gettext("Forget what was seen"),
      done: () => gettext("Remembered obstacles are forgotten."),
    },
  };
  #button;
  #question;
  #listening = new AbortController();

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ parts, request }) {
    this.#button = parts.forget;
    this.#question = question(parts["forget-dialog"], () => request({ t: "forget" }));
    this.mayAct = null;
    this.#button.addEventListener("click", () => this.#ask(), { signal: this.#listening.signal });
  }

  /** @param {?boolean} may whether this tab has control; null: not known yet */
  set mayAct(may) {
    dim(this.#button, !may, whyNotNow());
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
