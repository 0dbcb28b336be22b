/**
 * The stop button. It acts on the press, not on the release. It uses the socket; if there is no socket or no
 * answer in time, it uses the form's own address.
 */

import { inPageLanguage } from "../../formats/sentences.js";

const ANSWER_MS = 400;
const PATIENCE_MS = 4000; // the server itself reports a stop as pending after 2 s
export const SAID_MS = 5000; // display time of news about a stop: longer than the button waits for an answer
const SAME_PRESS_MS = 1000;
const PENDING = 202; // HTTP status: no robot refused, but not every robot has confirmed

export class StopButton {
  #form;
  #button;
  #send;
  #answered;
  #showText;
  #fail;
  #arrived;
  #posting = 0; // requests to the form's address without an answer yet
  #timer = null; // of the newest press: ends when the answer is late
  #pressedMs = -Infinity;
  #listening = new AbortController();

  /**
   * @param {HTMLFormElement} form its address receives the stop when the socket cannot
   * @param {object} ways
   * @param {() => boolean} ways.send sends over the socket; false if no answer can be expected there
   * @param {(sinceMs: number) => boolean} ways.answered whether the robot's side has reported a stop since
   *   that time
   * @param {() => void} [ways.arrived] the robot's side has reported the stop, where nothing else shows that
   * @param {(text: string) => void} ways.showText shows that the stop is on its way, and that it arrived
   * @param {(text: string, robots?: object) => void} ways.fail shows that the stop did not arrive, or not
   *   yet, and the remedy. `robots`: the answer of each robot's bridge, by slug, if the server sent it
   */
  constructor(form, { send, answered, arrived = () => {}, showText, fail }) {
    this.#form = form;
    this.#button = form.querySelector("button");
    this.#send = send;
    this.#answered = answered;
    this.#showText = showText;
    this.#fail = fail;
    this.#arrived = arrived;
    const { signal } = this.#listening;
    this.#button.addEventListener("pointerdown", () => this.press(), { signal });
    form.addEventListener("submit", (event) => this.#submitted(event), { signal });
  }

  /** Send a stop now. */
  press() {
    const sinceMs = performance.now();
    this.#pressedMs = sinceMs;
    clearTimeout(this.#timer);
    if (this.#send()) {
      this.#showText(gettext("Stop sent, waiting for the robot"));
      const check = () => (this.#answered(sinceMs) ? this.#arrived() : this.#post());
      this.#timer = setTimeout(check, ANSWER_MS);
    } else {
      this.#post();
    }
  }

  /** The socket reports that the stop did not arrive, or not yet; ignored while the form is tried. */
  refused(text) {
    if (!this.#posting) this.#fail(text);
  }

  close() {
    clearTimeout(this.#timer);
    this.#timer = null;
    this.#listening.abort();
  }

  /** Send a stop for a press without a pointer: by keyboard or assistive technology. */
  #submitted(event) {
    event.preventDefault();
    // A press with a pointer is followed by a click: one stop, not two.
    if (performance.now() - this.#pressedMs > SAME_PRESS_MS) this.press();
  }

  /** Send the stop to the form's address. Wait without limit: a late stop is reported, never withdrawn. */
  async #post() {
    this.#showText(gettext("Sending the stop"));
    this.#posting += 1;
    const late = setTimeout(() => this.#fail(noAnswer()), PATIENCE_MS);
    this.#timer = late;
    const failed = (...words) => this.#timer === late && this.#fail(...words); // only for the newest press
    try {
      const answer = await fetch(this.#form.action, {
        method: "POST",
        body: new FormData(this.#form),
        headers: { Accept: "application/json" },
        keepalive: true,
      });
      const { text, robots } = inPageLanguage(await answer.json()); // the server names the robots that did not confirm
      if (answer.ok && answer.status !== PENDING) this.#showText(text);
      else failed(text ?? noWay(), robots);
    } catch {
      failed(noWay());
    } finally {
      this.#posting -= 1;
      clearTimeout(late);
    }
  }
}

function noWay() {
  return gettext("The stop could not be sent. Use the red button on the robot.");
}

function noAnswer() {
  return gettext("No answer to the stop. Press again, or use the red button on the robot.");
}
