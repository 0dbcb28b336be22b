/** Words for those who listen: polite, never more often than every few seconds, always the newest. */

const PAUSE_MS = 4000;

export class Announcer {
  #element;
  #said = "";
  #waiting = null;
  #timer = null;

  /** @param {HTMLElement} element an aria-live region that only screen readers see */
  constructor(element) {
    this.#element = element;
  }

  /** @param {string} text @param {string} key what it is about: figures may change without a word */
  announce(text, key = text) {
    if (key === this.#said) return;
    this.#said = key;
    this.#waiting = text;
    if (this.#timer === null) this.#speak();
  }

  /** The subject of this key is over: its next text is news again. */
  forget(key) {
    if (key !== this.#said) return;
    this.#said = "";
    this.#waiting = null;
  }

  close() {
    clearTimeout(this.#timer);
  }

  #speak() {
    this.#timer = null;
    if (this.#waiting === null) return;
    this.#element.textContent = this.#waiting;
    this.#waiting = null;
    this.#timer = setTimeout(() => this.#speak(), PAUSE_MS);
  }
}
