/** The text that the robot speaks, with the spoken word marked and in sight. */

import { inLanguage } from "../formats/languages.js";
import { make, setText } from "../lib/dom.js";

/** Split a text into three: before the spoken word, the word, the rest. `word` counts code points. */
export function aroundWord(text, word) {
  if (!word) return ["", "", text];
  const letters = Array.from(text);
  const [from, to] = word;
  return [letters.slice(0, from), letters.slice(from, to), letters.slice(to)].map((part) =>
    part.join(""),
  );
}

export class SpeechLine {
  element;
  #pieces = ["span", "mark", "span"].map((tag) => make(tag));

  constructor() {
    this.element = make("p", { className: "runs-text", children: this.#pieces });
    this.element.dataset.part = "speech-text";
    this.#pieces[1].dataset.part = "speech-word";
    this.element.tabIndex = 0;
  }

  /** @param {{now: object}} speech of the robot */
  show({ now: { text, language, word } }) {
    inLanguage(this.element, language);
    const texts = aroundWord(text, word);
    for (const [i, piece] of this.#pieces.entries()) setText(piece, texts[i]);
    const { element } = this;
    const { offsetLeft, offsetWidth, offsetTop, offsetHeight } = this.#pieces[1];
    element.scrollLeft = texts[1] ? offsetLeft + offsetWidth / 2 - element.clientWidth / 2 : 0;
    element.scrollTop = texts[1] ? offsetTop + offsetHeight / 2 - element.clientHeight / 2 : 0;
  }
}
