/** The words beside "Stop all": news goes after some seconds, a failure stays until the same is pressed again. */

import { say } from "./dom.js";
import { SAID_MS } from "./stop.js";

export class StopWords {
  #element;
  #failures = new Map();
  #timer = null;

  constructor(element) {
    this.#element = element;
  }

  /** News of "Stop all", which is about every robot: what failed before counts no more. */
  say(text) {
    this.#failures.clear();
    this.#show(text);
    this.#timer = setTimeout(() => this.#show(""), SAID_MS);
  }

  /** @param {string} text @param {string} of whose stop failed: a robot's slug, or every robot's */
  fail(text, of = "") {
    this.#failures.set(of, text);
    this.#showFailures();
  }

  /** This robot's stop was pressed again, or arrived after all. */
  forget(of) {
    if (this.#failures.delete(of)) this.#showFailures();
  }

  close() {
    clearTimeout(this.#timer);
  }

  #showFailures() {
    this.#show([...new Set(this.#failures.values())].join(" "));
  }

  #show(text) {
    clearTimeout(this.#timer);
    say(this.#element, text);
  }
}
