/** Drawers of a small screen, for parts without room beside picture, stick and stop. At most one is open. */

import { mark } from "../../lib/dom.js";

const PRESSED = "aria-pressed";

export class Drawers {
  #root;
  #openers;
  #open = null;
  #listening = new AbortController();

  /** @param {HTMLElement} root gets data-drawer-shown for the style sheet; holds openers and drawers */
  constructor(root) {
    this.#root = root;
    this.#openers = new Map(
      [...root.querySelectorAll("[data-drawer-open]")].map((one) => [one.dataset.drawerOpen, one]),
    );
    const { signal } = this.#listening;
    root.addEventListener("click", ({ target }) => this.#clicked(target), { signal });
    root.addEventListener(
      "keydown",
      (event) => {
        if (event.key === "Escape" && !event.defaultPrevented) this.close();
      },
      { signal },
    );
  }

  /** Close the open drawer. No drawer may hide the picture while a person drives. */
  close() {
    if (this.#open === null) return;
    const opener = this.#openers.get(this.#open);
    if (this.#drawer(this.#open).contains(document.activeElement)) opener.focus();
    this.#show(null);
  }

  end() {
    this.#listening.abort();
  }

  #clicked(target) {
    const opener = target.closest("[data-drawer-open]");
    if (opener)
      this.#show(opener.dataset.drawerOpen === this.#open ? null : opener.dataset.drawerOpen);
    else if (target.closest("[data-drawer-close]")) this.close();
    else this.#choose(target.closest(".drawer-head [data-shows]"));
  }

  #show(name) {
    this.#open = name;
    mark(this.#root, "drawerShown", name);
    for (const [own, opener] of this.#openers)
      opener.setAttribute("aria-expanded", String(own === name));
  }

  /** Shows the chosen list of a drawer. */
  #choose(button) {
    if (!button) return;
    const drawer = button.closest("[data-drawer]");
    mark(drawer, "shows", button.dataset.shows);
    for (const other of drawer.querySelectorAll(".drawer-head [data-shows]"))
      other.setAttribute(PRESSED, String(other === button));
  }

  #drawer(name) {
    return this.#root.querySelector(`[data-drawer="${name}"]`);
  }
}
