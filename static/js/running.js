/** What the robot performs and says, on every tab, each with its Cancel. */

import { say, show } from "./dom.js";
import { inLanguage } from "./languages.js";

/** A text in three: before the word that is spoken, the word, and the rest. `word` counts characters, not UTF-16 units. */
export function aroundWord(text, word) {
  if (!word) return ["", "", text];
  const letters = Array.from(text);
  const [from, to] = word;
  return [letters.slice(0, from), letters.slice(from, to), letters.slice(to)].map((part) =>
    part.join(""),
  );
}

function statusText(status) {
  const texts = {
    sent: gettext("Sent"),
    accepted: gettext("Accepted"),
    speaking: gettext("Speaking"),
  };
  return texts[status] ?? status;
}

export class Running {
  #parts;
  #titleOf;
  #listening = new AbortController();

  /**
   * @param {Record<string, HTMLElement>} parts
   * @param {(order: object) => void} send
   * @param {(motion: string) => string} titleOf a motion, for people
   */
  constructor(parts, send, titleOf) {
    this.#parts = parts;
    this.#titleOf = titleOf;
    const { signal } = this.#listening;
    for (const [button, t] of [
      ["motion-cancel", "play_cancel"],
      ["speech-cancel", "say_cancel"],
    ])
      parts[button].addEventListener("click", () => send({ t }), { signal });
  }

  /** @param {object} state of the robot */
  set state({ motion = null, speech = null }) {
    show(this.#parts["motion-runs"], motion !== null);
    show(this.#parts["speech-runs"], speech !== null);
    show(this.#parts.running, motion !== null || speech !== null);
    if (motion) {
      say(this.#parts["motion-name"], this.#titleOf(motion.name));
      say(this.#parts["motion-who"], interpolate(gettext("for %s"), [motion.who]));
    }
    if (speech) this.#showSpeech(speech);
  }

  /** @param {boolean} may this person may end what runs */
  set mayCancel(may) {
    show(this.#parts["motion-cancel"], may);
    show(this.#parts["speech-cancel"], may);
  }

  close() {
    this.#listening.abort();
  }

  #showSpeech({ text, language, status, word, who }) {
    const line = this.#parts["speech-text"];
    say(this.#parts["speech-status"], statusText(status));
    say(this.#parts["speech-who"], interpolate(gettext("for %s"), [who]));
    const [before, spoken, after] = aroundWord(text, word);
    inLanguage(line, language);
    say(this.#parts["speech-before"], before);
    say(this.#parts["speech-word"], spoken);
    say(this.#parts["speech-after"], after);
    const { offsetLeft, offsetWidth, offsetTop, offsetHeight } = this.#parts["speech-word"];
    line.scrollLeft = spoken ? offsetLeft + offsetWidth / 2 - line.clientWidth / 2 : 0;
    line.scrollTop = spoken ? offsetTop + offsetHeight / 2 - line.clientHeight / 2 : 0;
  }
}
