/** The control page on the whole screen, with joystick and stop over the picture. */

import { mark, show } from "../lib/dom.js";

export class FullScreen {
  #root;
  #button;
  #listening = new AbortController();

  /**
   * @param {HTMLElement} root fills the screen: it must contain the stop
   * @param {HTMLButtonElement} button
   */
  constructor(root, button) {
    this.#root = root;
    this.#button = button;
    show(button, Boolean(document.fullscreenEnabled)); // iPhones have no full screen
    const { signal } = this.#listening;
    button.addEventListener("click", () => this.#toggle(), { signal });
    document.addEventListener("fullscreenchange", () => this.#follow(), { signal });
  }

  close() {
    this.#listening.abort();
  }

  get #isFull() {
    return document.fullscreenElement === this.#root;
  }

  async #toggle() {
    try {
      if (this.#isFull) await document.exitFullscreen();
      else await this.#root.requestFullscreen();
    } catch {
      // The browser's own settings forbid it: the page stays as it is.
    }
  }

  #follow() {
    mark(this.#root, "full", this.#isFull);
    this.#button.setAttribute("aria-pressed", String(this.#isFull));
  }
}
