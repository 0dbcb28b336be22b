/** Marks the layout of a phone held sideways, and of the whole screen: the picture below everything else. */

import { mark } from "../../lib/dom.js";

const LOW = "(orientation: landscape) and (max-height: 34.9375em)";

export class Over {
  #root;
  #low = matchMedia(LOW);
  #wide = matchMedia("(orientation: landscape)");
  #listening = new AbortController();

  /** @param {HTMLElement} root gets data-over for the style sheet, as the page's body does */
  constructor(root) {
    this.#root = root;
    const { signal } = this.#listening;
    const follow = () => this.#follow();
    for (const query of [this.#low, this.#wide])
      query.addEventListener("change", follow, { signal });
    document.addEventListener("fullscreenchange", follow, { signal });
    this.#follow();
  }

  close() {
    this.#listening.abort();
  }

  #follow() {
    const isWhole = document.fullscreenElement === this.#root && this.#wide.matches;
    for (const element of [this.#root, document.body])
      mark(element, "over", this.#low.matches || isWhole);
  }
}
