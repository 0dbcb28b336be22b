/**
 * A stick or button that is held by a finger, a pen or the main mouse button.
 *
 * Each pointer event says which buttons are down now, and only that counts: after a menu, a page hears of no release.
 */

import { hand, isModified } from "./watch.js";

const PRIMARY = 1; // in `buttons`: the main button alone

export class PointerGrip {
  #element;
  #door;
  #pointer = null; // id of the pointer that is down
  #isHeld = false; // false although the pointer is down: the grip was lost, the pointer must lift first
  #seen = ""; // what the last event said
  #listening = new AbortController();

  /**
   * @param {HTMLElement} element
   * @param {object} door
   * @param {(event: PointerEvent) => boolean} door.begin return whether a press begins a grip
   * @param {(event: PointerEvent) => void} [door.move]
   * @param {(reason: ?string, event: ?PointerEvent) => void} door.end the grip ended; null: the hand lifted
   * @param {() => void} [door.rest] the pointer lifted, also after the grip was lost
   * @param {number} [door.patienceMs] how long a finger counts that sends nothing
   * @param {boolean} [door.hasMenu] a picture: a right click opens the browser's menu, a press takes the focus from fields
   */
  constructor(
    element,
    { begin, move = () => {}, end, rest = () => {}, patienceMs, hasMenu = false },
  ) {
    this.#element = element;
    this.#door = { begin, move, end, rest, patienceMs, hasMenu };
    const { signal } = this.#listening;
    element.addEventListener("pointerdown", (event) => this.#press(event), { signal });
    const menu = (event) => {
      if (!hasMenu || event.pointerType === "touch") event.preventDefault(); // a long touch is a grip
    };
    element.addEventListener("contextmenu", menu, { signal });
    element.addEventListener("dragstart", (event) => event.preventDefault(), { signal });
    for (const type of ["pointermove", "pointerup", "pointercancel", "lostpointercapture"])
      window.addEventListener(type, (event) => this.#judge(event), { signal, capture: true });
  }

  get isHeld() {
    return this.#isHeld;
  }

  /** End the grip now, also if the finger is still down. */
  drop(reason) {
    hand.lose(this, reason);
  }

  /** @param {string} reason called by the watch */
  lose(reason) {
    this.#isHeld = false;
    this.#door.end(reason, null);
  }

  close() {
    this.drop("closed");
    this.#listening.abort();
  }

  #press(event) {
    const wasLost = !this.#isHeld || event.pointerId === this.#pointer; // the page may never hear of its release
    if (this.#pointer !== null && wasLost) this.#lift(event);
    if (this.#pointer !== null || event.buttons !== PRIMARY || event.button !== 0) return;
    if (isModified(event) || !hand.admit() || !this.#captures(event)) return;
    if (!this.#door.begin(event)) return this.#element.releasePointerCapture?.(event.pointerId);
    if (!this.#door.hasMenu) event.preventDefault();
    this.#pointer = event.pointerId;
    this.#isHeld = true;
    this.#seen = sightOf(event);
    hand.begin(this, this.#door.patienceMs);
    this.#door.move(event);
  }

  /** Return whether a pointer is down: a program that clicks makes events without one, and may send no release. */
  #captures({ pointerId }) {
    try {
      this.#element.setPointerCapture?.(pointerId);
      return true;
    } catch {
      return false;
    }
  }

  #judge(event) {
    if (event.pointerId !== this.#pointer) return;
    if (event.buttons === 0 || event.type === "pointercancel") return this.#lift(event);
    if (event.type === "lostpointercapture") return this.drop("taken");
    if (event.buttons !== PRIMARY) return this.drop("button");
    if (isModified(event)) return this.drop("modifier");
    if (!this.#isHeld) return;
    // Browsers repeat an event when the page changes under a mouse that rests: that proves nothing.
    if (sightOf(event) === this.#seen) return;
    this.#seen = sightOf(event);
    hand.prove(this);
    this.#door.move(event);
  }

  #lift(event) {
    this.#pointer = null;
    if (this.#isHeld && event.type === "pointerup" && event.button === 0) {
      this.#isHeld = false;
      hand.end(this);
      this.#door.end(null, event);
    } else {
      this.drop(event.type === "pointercancel" ? "taken" : "button");
    }
    this.#door.rest();
  }
}

function sightOf({ screenX, screenY, pressure, width, height, tiltX, tiltY, twist }) {
  return [screenX, screenY, pressure, width, height, tiltX, tiltY, twist].join(" ");
}
