/** Signals at the moments that a person must not miss, by sound, vibration and speech, as the person chose. */

import { show } from "../../lib/dom.js";
import { isHeld } from "../status/status_text.js";
import { WAYS } from "./ways.js";

const PAUSE_MS = 3000; // from one signal to the next
const FIRST_LOOK_MS = 1000; // a page that has just been opened tells nothing: the person looks at it

/**
 * Return which moment this is; null: none that a person must not miss. Pure.
 * @param {object} state of the robot, the newest
 * @param {?object} silence which part of the way to the robot is silent
 * @returns {"lost" | "stop" | "held" | null}
 */
export function momentOf(state, silence) {
  if (silence) return "lost";
  if (state.stop.state !== "clear") return "stop";
  return isHeld(state.verdict) ? "held" : null;
}

export class Signals {
  #choices;
  #ways;
  #told = null; // the moment that was told last, and lasts
  #toldMs = -Infinity;
  #sinceMs = null; // when the page first knew the robot
  #listening = new AbortController();

  /**
   * @param {Record<string, HTMLElement>} parts has a button `signal-NAME` for each way
   * @param {import("../choices.js").Choices} choices of the person
   * @param {import("./ways.js").Way[]} [ways]
   */
  constructor(parts, choices, ways = WAYS) {
    this.#choices = choices;
    this.#ways = ways.filter((way) => way.isThere());
    for (const way of this.#ways) this.#offer(way, parts[`signal-${way.name}`]);
  }

  /**
   * Follow the state; called again and again.
   * @param {?object} state of the robot, the newest; null: none came yet
   * @param {?object} silence
   * @param {string} words the reason that the page shows
   */
  follow(state, silence, words, nowMs = performance.now()) {
    if (!state) return;
    this.#sinceMs ??= nowMs;
    const moment = momentOf(state, silence);
    if (moment === this.#told) return;
    const isNews = moment !== null && nowMs - this.#sinceMs >= FIRST_LOOK_MS;
    if (isNews && nowMs - this.#toldMs < PAUSE_MS) return; // told later, if it still lasts
    this.#told = moment;
    if (!isNews) return;
    this.#toldMs = nowMs;
    for (const way of this.#ways) if (this.#isOn(way)) way.tell(moment, words);
  }

  close() {
    this.#listening.abort();
  }

  #isOn({ name, isOn }) {
    return this.#choices.recall(name, isOn);
  }

  #offer(way, button) {
    const showChoice = () => button.setAttribute("aria-pressed", String(this.#isOn(way)));
    const choose = () => {
      this.#choices.remember(way.name, !this.#isOn(way));
      showChoice();
      if (this.#isOn(way)) way.tell("held", button.textContent); // so that the person knows it
    };
    button.addEventListener("click", choose, { signal: this.#listening.signal });
    showChoice();
    show(button, true);
  }
}
