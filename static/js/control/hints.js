/**
 * Three hints for a first visit: take control, push the stick, stop. A hint disappears when its step is done,
 * or by a press. The hints are shown once for each account.
 */

import { mark, setText, show } from "../lib/dom.js";

const STEPS = ["take", "stick", "stop"];

function hintText(step) {
  return {
    take: gettext("Press Take control: then you drive, and nobody else."),
    stick: gettext("Push the stick: up is forward. Let go, and the robot stands."),
    stop: gettext("Stop works at any time, for everybody. Press it whenever you are not sure."),
  }[step];
}

export class Hints {
  #root;
  #parts;
  #choices;
  #step = null;
  #listening = new AbortController();

  /**
   * @param {HTMLElement} root gets data-hint for the style sheet
   * @param {{"first-steps", "hint-count", "hint-text", "hint-next", "hint-close", "hints-open"}} parts
   * @param {import("./choices.js").Choices} choices of the person: whether the hints were seen
   */
  constructor(root, parts, choices) {
    this.#root = root;
    this.#parts = parts;
    this.#choices = choices;
    const { signal } = this.#listening;
    parts["hint-next"].addEventListener("click", () => this.#next(), { signal });
    parts["hint-close"].addEventListener("click", () => this.#end(), { signal });
    parts["hints-open"].addEventListener("click", () => this.#show(0), { signal });
  }

  /** Begin, if the person has not seen the hints. For people who may drive. */
  begin() {
    if (this.#step === null && !this.#choices.recall("hints_seen", false)) this.#show(0);
  }

  /** @param {"take" | "stick" | "stop"} step that the person has just done */
  done(step) {
    if (STEPS[this.#step] === step) this.#next();
  }

  close() {
    this.#listening.abort();
  }

  #next() {
    if (this.#step === STEPS.length - 1) this.#end();
    else this.#show(this.#step + 1);
  }

  #show(step) {
    this.#step = step;
    mark(this.#root, "hint", STEPS[step]);
    const {
      "first-steps": card,
      "hint-count": count,
      "hint-text": text,
      "hint-next": next,
    } = this.#parts;
    setText(count, interpolate(gettext("%s of %s"), [step + 1, STEPS.length]));
    setText(text, hintText(STEPS[step]));
    setText(next, step === STEPS.length - 1 ? gettext("Got it") : gettext("Next"));
    show(card, true);
  }

  #end() {
    this.#step = null;
    this.#choices.remember("hints_seen", true);
    mark(this.#root, "hint", null);
    show(this.#parts["first-steps"], false);
  }
}
