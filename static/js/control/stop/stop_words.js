/**
 * The words next to "Stop all": news disappears after some seconds, a failure stays until the same stop is
 * pressed again.
 */

import { setText } from "../../lib/dom.js";
import { SAID_MS } from "./stop_button.js";

export class StopWords {
  #element;
  // By the slug of the robot, or "" for all: the text, or the name of a robot that was not reached.
  #failures = new Map();
  #timer = null;

  constructor(element) {
    this.#element = element;
  }

  /** Show news of "Stop all", which concerns every robot: earlier failures are cleared. */
  showText(text) {
    this.#failures.clear();
    this.#show(text);
    this.#timer = setTimeout(() => this.#show(""), SAID_MS);
  }

  /** @param {string} text @param {string} of the slug of the robot whose stop failed; "" for every robot */
  fail(text, of = "") {
    this.#failures.set(of, { text });
    this.#showFailures();
  }

  /**
   * @param {string} name of a robot that did not confirm the stop
   * @param {string} of its slug
   * @param {boolean} pending the server still tries to deliver the stop
   */
  unreached(name, of, pending = false) {
    this.#failures.set(of, { name, pending });
    this.#showFailures();
  }

  /** This robot reports that it is stopped: a pending stop has arrived. */
  delivered(of) {
    if (this.#failures.get(of)?.pending) this.forget(of);
  }

  /** This robot's stop was pressed again, or arrived after all. */
  forget(of) {
    if (this.#failures.delete(of)) this.#showFailures();
  }

  close() {
    clearTimeout(this.#timer);
  }

  #showFailures() {
    const failures = [...this.#failures.values()];
    const named = (waits) => failures.filter(({ name, pending }) => name && pending === waits);
    const names = (waits) => [
      named(waits)
        .map(({ name }) => name)
        .join(", "),
    ];
    const unreached = gettext("Not reached: %s. Use the red button on the robot.");
    const waiting = gettext(
      "Pending, not confirmed yet: %s. The stop will be delivered as soon as possible. Use the red button on the robot.",
    );
    const texts = failures.map(
      ({ text, pending }) => text ?? interpolate(pending ? waiting : unreached, names(pending)),
    );
    this.#show([...new Set(texts)].join(" "), "alert");
  }

  /** @param {"status" | "alert"} role alert: a screen reader reads the text at once; status: later */
  #show(text, role = "status") {
    clearTimeout(this.#timer);
    this.#element.setAttribute("role", role);
    setText(this.#element, text);
  }
}
