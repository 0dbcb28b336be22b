/** The tabs of the control page. The address names the tab, so that back and reload work. */

import { readingKey } from "../formats/languages.js";
import { mark } from "./dom.js";

/** The tab that an address names: null if it names none. */
export function tabIn(hash, tabs) {
  const name = hash.replace(/^#/, "") || tabs[0];
  return tabs.includes(name) ? name : null;
}

/**
 * Return the tab to which a key moves from another tab; null: the key does not change tabs.
 * @param {string} key as `readingKey` returns it
 */
export function tabByKey(key, from, tabs) {
  const at = tabs.indexOf(from);
  switch (key) {
    case "ArrowRight":
      return tabs[(at + 1) % tabs.length];
    case "ArrowLeft":
      return tabs.at(at - 1);
    case "Home":
      return tabs[0];
    case "End":
      return tabs.at(-1);
    default:
      return null;
  }
}

/** Events: "change" (detail: {tab, before}); `before` is null for the tab with which the page opens. */
export class Tabs extends EventTarget {
  #root;
  #links;
  #panel;
  #current = null;
  #listening = new AbortController();

  /**
   * @param {HTMLElement} root gets data-tab for the style sheet, and data-stick on the tabs with the joystick
   * @param {HTMLElement} list has links with role "tab" and a tab's name as hash; the first is the default. A
   *   link with data-stick: its tab has the joystick.
   * @param {HTMLElement} panel the content of all tabs
   */
  constructor(root, list, panel) {
    super();
    this.#root = root;
    this.#panel = panel;
    this.#links = new Map(
      [...list.querySelectorAll("[role=tab]")].map((link) => [link.hash.slice(1), link]),
    );
    const { signal } = this.#listening;
    list.addEventListener("keydown", (event) => this.#key(event), { signal });
    list.addEventListener("click", (event) => this.#clicked(event), { signal });
    window.addEventListener("hashchange", () => this.#follow(), { signal });
  }

  /** Shows the tab that the address names. */
  begin() {
    this.#follow();
  }

  close() {
    this.#listening.abort();
  }

  get #names() {
    return [...this.#links.keys()];
  }

  #follow() {
    const tab = tabIn(location.hash, this.#names);
    if (tab) this.#show(tab);
    else if (this.#current)
      history.replaceState(null, "", `#${this.#current}`); // e.g. the link "skip to the page"
    else this.#show(this.#names[0]);
  }

  #show(tab) {
    const before = this.#current;
    if (tab === before) return;
    this.#current = tab;
    for (const [name, link] of this.#links) {
      link.setAttribute("aria-selected", String(name === tab));
      link.tabIndex = name === tab ? 0 : -1;
    }
    this.#links.get(tab).scrollIntoView({ block: "nearest", inline: "nearest" });
    this.#panel.setAttribute("aria-labelledby", this.#links.get(tab).id);
    mark(this.#root, "tab", tab);
    mark(this.#root, "stick", "stick" in this.#links.get(tab).dataset);
    this.dispatchEvent(new CustomEvent("change", { detail: { tab, before } }));
  }

  /** Arrow keys in the tablist change tabs: from here they do not drive. */
  #key(event) {
    const link = event.target.closest("[role=tab]");
    if (!link || event.ctrlKey || event.altKey || event.metaKey) return;
    const tab = tabByKey(readingKey(event.key), link.hash.slice(1), this.#names);
    if (tab === null) return;
    event.preventDefault();
    event.stopPropagation();
    this.#links.get(tab).focus();
    this.#go(tab);
  }

  /** A clicked tab gives up the focus, so that keys drive again. */
  #clicked(event) {
    const link = event.target.closest("[role=tab]");
    if (!link || event.ctrlKey || event.shiftKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    if (event.detail > 0) link.blur();
    this.#go(link.hash.slice(1));
  }

  /** Show a tab at once: browsers report a new hash some time later, and a key may be pressed before. */
  #go(tab) {
    location.hash = tab;
    this.#follow();
  }
}
