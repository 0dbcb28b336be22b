/** The parts of the control page. The address names the one that is shown, so that back and reload work. */

export const TABS = ["centre", "drive", "motions", "speech", "topics"];

/** @param {string} hash of an address. @returns {string} the tab that it names, else the first */
export function tabOf(hash) {
  const name = hash.replace(/^#/, "");
  return TABS.includes(name) ? name : TABS[0];
}

/** Event "change" (detail: the tab's name) whenever another one is shown. */
export class Tabs extends EventTarget {
  #root;
  #links;
  #shown = null;
  #listening = new AbortController();

  /** @param {HTMLElement} root whose data-tab the style sheet reads @param {HTMLElement} nav links to "#name" */
  constructor(root, nav) {
    super();
    this.#root = root;
    this.#links = [...nav.querySelectorAll("a")];
    const { signal } = this.#listening;
    window.addEventListener("hashchange", () => this.#follow(), { signal });
    this.#follow();
  }

  get shown() {
    return this.#shown;
  }

  close() {
    this.#listening.abort();
  }

  #follow() {
    const shown = tabOf(location.hash);
    if (shown === this.#shown) return;
    this.#shown = shown;
    this.#root.dataset.tab = shown;
    for (const link of this.#links) {
      if (link.hash === `#${shown}`) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    }
    for (const part of this.#root.querySelectorAll("[data-tabs]")) {
      part.hidden = !part.dataset.tabs.split(" ").includes(shown);
    }
    this.dispatchEvent(new CustomEvent("change", { detail: shown }));
  }
}
