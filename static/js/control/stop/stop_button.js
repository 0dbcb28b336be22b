/**
 * The stop button. It acts on the press, not on the release; it uses the socket, and the form's own address
 * when the socket is not there or nothing is heard back in time.
 */

const ANSWER_MS = 400;
const PATIENCE_MS = 4000; // the server itself calls a stop pending after 2 s
export const SAID_MS = 5000; // display time of news about a stop: longer than it waits for an answer
const SAME_PRESS_MS = 1000;
const PENDING = 202; // no robot refused, but not every one has confirmed

export class StopButton {
  #form;
  #button;
  #send;
  #answered;
  #say;
  #fail;
  #arrived;
  #posting = 0; // by the form's address, and not answered yet
  #timer = null; // of the newest press: when its answer is late
  #pressedMs = -Infinity;
  #listening = new AbortController();

  /**
   * @param {HTMLFormElement} form its address takes the stop when the socket cannot
   * @param {object} ways
   * @param {() => boolean} ways.send over the socket; false if no answer can be expected there
   * @param {(sinceMs: number) => boolean} ways.answered whether the robot's side has reported a stop since
   * @param {() => void} [ways.arrived] the robot's side has reported it, where nothing else shows that
   * @param {(text: string) => void} ways.say that it is on its way, and that it arrived
   * @param {(text: string, robots?: object) => void} ways.fail that it did not arrive, or not yet, and what to do;
   *   what each robot's bridge answered, by slug, if the server said so
   */
  constructor(form, { send, answered, arrived = () => {}, say, fail }) {
    this.#form = form;
    this.#button = form.querySelector("button");
    this.#send = send;
    this.#answered = answered;
    this.#say = say;
    this.#fail = fail;
    this.#arrived = arrived;
    const { signal } = this.#listening;
    this.#button.addEventListener("pointerdown", () => this.press(), { signal });
    form.addEventListener("submit", (event) => this.#submitted(event), { signal });
  }

  /** Stop, now. */
  press() {
    const sinceMs = performance.now();
    this.#pressedMs = sinceMs;
    clearTimeout(this.#timer);
    if (this.#send()) {
      this.#say(gettext("Stop sent, waiting for the robot"));
      const look = () => (this.#answered(sinceMs) ? this.#arrived() : this.#post());
      this.#timer = setTimeout(look, ANSWER_MS);
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

  /** Keyboards and assistive technology press without a pointer. */
  #submitted(event) {
    event.preventDefault();
    // A press with a pointer is followed by a click: one stop, not two.
    if (performance.now() - this.#pressedMs > SAME_PRESS_MS) this.press();
  }

  /** Wait without limit: a stop under way is never withdrawn, only reported as late. */
  async #post() {
    this.#say(gettext("Sending the stop"));
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
      const { text, robots } = await answer.json(); // the server names the robots that did not confirm
      if (answer.ok && answer.status !== PENDING) this.#say(text);
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
