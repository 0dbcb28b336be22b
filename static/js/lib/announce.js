/** Texts for screen readers: polite, at most one every few seconds, always the newest. */

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

  /**
   * @param {string} text
   * @param {string} key the subject: a text with the same key is not announced again, even with other figures
   */
  announce(text, key = text) {
    if (key === this.#said) return;
    this.#said = key;
    this.#waiting = text;
    if (this.#timer === null) this.#speak();
  }

  /** Forget a key: the next text with this key is announced again. */
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
