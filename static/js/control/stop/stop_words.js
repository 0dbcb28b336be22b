/** The words next to "Stop all": news disappears after some seconds, a failure stays until the same stop is pressed again. */

import { setText } from "../../lib/dom.js";
import { SAID_MS } from "./stop_button.js";

export class StopWords {
  #element;
  #failures = new Map(); // by whose stop failed: what to say, or the name of a robot that was not reached
  #timer = null;

  constructor(element) {
    this.#element = element;
  }

  /** News of "Stop all", which concerns every robot: earlier failures are cleared. */
  say(text) {
    this.#failures.clear();
    this.#show(text);
    this.#timer = setTimeout(() => this.#show(""), SAID_MS);
  }

  /** @param {string} text @param {string} of whose stop failed: a robot's slug, or every robot's */
  fail(text, of = "") {
    this.#failures.set(of, { text });
    this.#showFailures();
  }

  /**
   * @param {string} name of a robot that did not confirm the stop
   * @param {string} of its slug
   * @param {boolean} pending the server goes on delivering it
   */
  unreached(name, of, pending = false) {
    this.#failures.set(of, { name, pending });
    this.#showFailures();
  }

  /** This robot reports that it is stopped: the stop does not wait any more. */
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

  /** @param {"status" | "alert"} role by which a screen reader waits with it, or does not */
  #show(text, role = "status") {
    clearTimeout(this.#timer);
    this.#element.setAttribute("role", role);
    setText(this.#element, text);
  }
}
