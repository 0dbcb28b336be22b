/**
 * Where the panels are on a large screen: people drag them by handles, or move them by arrow keys. Kept for
 * each account.
 */

import { readingKey } from "../../formats/languages.js";
import { mark } from "../../lib/dom.js";

const PLACES = ["left", "top", "bottom"]; // beside the stick; at the other side, above and below
const STANDARD = { chart: "left", motions: "top", phrases: "bottom" };
const STEPS = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 };

function placeWords(place) {
  return {
    left: gettext("above the stick"),
    top: gettext("beside the picture, above"),
    bottom: gettext("beside the picture, below"),
  }[place];
}

/** Exchange a panel with the panel at its new place. Pure. @param {Record<string, string>} places by panel */
export function moved(places, panel, place) {
  const there = Object.keys(places).find((other) => places[other] === place);
  return { ...places, [there]: places[panel], [panel]: place };
}

/** Return whether a stored value is an arrangement: each panel has its own place. */
function isArrangement(places) {
  const kept = Object.keys(STANDARD).map((panel) => places?.[panel]);
  return PLACES.every((place) => kept.includes(place));
}

export class Panels {
  #panels;
  #places;
  #choices;
  #notify;
  #dragged = null;
  #listening = new AbortController();

  /**
   * @param {HTMLElement} root its elements with data-panel are the panels, those with data-moves their
   *   handles
   * @param {import("../choices.js").Choices} choices of the person
   * @param {(text: string) => void} notify reports a move to screen readers
   */
  constructor(root, choices, notify) {
    this.#choices = choices;
    this.#notify = notify;
    this.#panels = new Map(
      [...root.querySelectorAll("[data-panel]")].map((panel) => [panel.dataset.panel, panel]),
    );
    const kept = choices.recall("panels", STANDARD);
    this.#place(isArrangement(kept) ? kept : STANDARD);
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

  /** Move all panels back. */
  reset() {
    this.#place(STANDARD);
    this.#choices.remember("panels", STANDARD);
  }

  #place(places) {
    this.#places = places;
    for (const [name, panel] of this.#panels) mark(panel, "place", places[name]);
  }

  #move(name, place) {
    if (place === undefined || this.#places[name] === place) return;
    this.#place(moved(this.#places, name, place));
    this.#choices.remember("panels", this.#places);
    this.#notify(placeWords(place));
  }

  /** Arrow keys on a handle move the panel: they do not drive. */
  #pressed(event, handle) {
    const step = STEPS[readingKey(event.key)];
    if (!step || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    event.stopPropagation();
    const name = handle.dataset.moves;
    this.#move(name, PLACES[PLACES.indexOf(this.#places[name]) + step]);
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
    if (over) this.#move(this.#dragged, this.#places[over]);
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
