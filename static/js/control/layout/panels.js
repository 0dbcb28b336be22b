/** Where the panels are on a large screen: people drag them by handles, or move them by arrow keys. */

import { readingKey } from "../../formats/languages.js";
import { mark } from "../../lib/dom.js";

const PLACES = ["left", "top", "bottom"]; // beside the stick; at the other side, above and below
const STEPS = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 };

/** The panels at the places, in this order: above the stick; at the other side, above and below. */
export const STANDARD_ORDER = ["chart", "motions", "phrases"];

function placeWords(place) {
  return {
    left: gettext("above the stick"),
    top: gettext("beside the picture, above"),
    bottom: gettext("beside the picture, below"),
  }[place];
}

/** Exchange a panel with the panel at its new place. Pure. @param {string[]} order of the panels */
export function moved(order, panel, at) {
  return order.with(order.indexOf(panel), order[at]).with(at, panel);
}

/** Return the order of panels whose places were kept by name; the usual order if one has none. */
export function orderOf(places) {
  const order = PLACES.map((place) => STANDARD_ORDER.find((panel) => places[panel] === place));
  return order.includes(undefined) ? STANDARD_ORDER : order;
}

/** Event: "move" (detail: the new order). */
export class Panels extends EventTarget {
  #panels;
  #order = STANDARD_ORDER;
  #notify;
  #dragged = null;
  #listening = new AbortController();

  /**
   * @param {HTMLElement} root its elements with data-panel are the panels, those with data-moves their
   *   handles
   * @param {(notice: object) => void} notify reports a move to screen readers
   */
  constructor(root, notify) {
    super();
    this.#notify = notify;
    this.#panels = new Map(
      [...root.querySelectorAll("[data-panel]")].map((panel) => [panel.dataset.panel, panel]),
    );
    const { signal } = this.#listening;
    for (const handle of root.querySelectorAll("[data-moves]")) {
      handle.addEventListener("keydown", (event) => this.#pressed(event, handle), { signal });
      handle.addEventListener("pointerdown", (event) => this.#grab(event, handle), { signal });
      handle.addEventListener("pointermove", (event) => this.#drag(event), { signal });
      handle.addEventListener("pointerup", (event) => this.#drop(event), { signal });
      handle.addEventListener("pointercancel", () => this.#letGo(), { signal });
    }
  }

  close() {
    this.#listening.abort();
  }

  /** @param {string[]} order of the panels at the places */
  set order(order) {
    this.#order = order;
    for (const [name, panel] of this.#panels) mark(panel, "place", PLACES[order.indexOf(name)]);
  }

  #move(name, at) {
    const place = PLACES[at];
    if (place === undefined || this.#order[at] === name) return;
    this.dispatchEvent(new CustomEvent("move", { detail: moved(this.#order, name, at) }));
    this.#notify({ level: "success", code: "moved", text: placeWords(place), quiet: true });
  }

  /** Arrow keys on a handle move the panel: they do not drive. */
  #pressed(event, handle) {
    const step = STEPS[readingKey(event.key)];
    if (!step || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    event.stopPropagation();
    const name = handle.dataset.moves;
    this.#move(name, this.#order.indexOf(name) + step);
    handle.focus();
  }

  #grab(event, handle) {
    event.preventDefault();
    handle.focus();
    handle.setPointerCapture?.(event.pointerId);
    this.#dragged = handle.dataset.moves;
    mark(this.#panels.get(this.#dragged), "dragged", true);
  }

  #drag(event) {
    if (this.#dragged === null) return;
    const over = this.#at(event);
    for (const [name, panel] of this.#panels)
      mark(panel, "target", name === over && name !== this.#dragged);
  }

  #drop(event) {
    if (this.#dragged === null) return;
    const over = this.#at(event);
    if (over) this.#move(this.#dragged, this.#order.indexOf(over));
    this.#letGo();
  }

  #letGo() {
    this.#dragged = null;
    for (const panel of this.#panels.values()) {
      mark(panel, "dragged", false);
      mark(panel, "target", false);
    }
  }

  /** The panel under the pointer. */
  #at({ clientX: x, clientY: y }) {
    for (const [name, panel] of this.#panels) {
      const { left, right, top, bottom } = panel.getBoundingClientRect();
      if (x >= left && x <= right && y >= top && y <= bottom) return name;
    }
    return null;
  }
}
