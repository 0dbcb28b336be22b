/** Keys that move something while they are held. A key counts by its position, not by its letter. */

import { isEditing } from "../lib/editing.js";
import { hand, isComposing, isModified } from "./watch.js";

export class HeldKeys {
  #held = new Set();
  #codes;
  #changed;
  #listening = new AbortController();

  /**
   * @param {EventTarget} target whose keys are heard
   * @param {string[]} codes
   * @param {() => boolean} may return whether a press counts now
   * @param {(held: ReadonlySet<string>, lost: ?string, event: ?KeyboardEvent) => void} changed `lost`: why all ended
   *   without the hand
   */
  constructor(target, codes, may, changed) {
    this.#codes = new Set(codes);
    this.#changed = changed;
    const { signal } = this.#listening;
    target.addEventListener("keydown", (event) => this.#down(event, may), { signal });
    window.addEventListener("keyup", (event) => this.#up(event), { signal });
  }

  /** Forget all keys; each must be pressed again. */
  drop(reason) {
    hand.lose(this, reason);
  }

  /** @param {string} reason called by the watch */
  lose(reason) {
    this.#held.clear();
    this.#changed(this.#held, reason, null);
  }

  close() {
    this.drop("closed");
    this.#listening.abort();
  }

  #down(event, may) {
    if (isEditing(event.target) || isModified(event) || isComposing(event)) return;
    if (!this.#codes.has(event.code)) return hand.prove(this); // a live keyboard: a hand is there
    if (!may()) return;
    event.preventDefault();
    if (this.#held.has(event.code)) return hand.prove(this, event);
    if (event.repeat) return; // it was held when input ended: it must be pressed again
    if (this.#held.size === 0) hand.begin(this);
    else hand.prove(this);
    this.#held.add(event.code);
    this.#changed(this.#held, null, event);
  }

  #up(event) {
    hand.prove(this);
    if (!this.#held.delete(event.code)) return;
    if (this.#held.size === 0) hand.end(this);
    this.#changed(this.#held, null, event);
  }
}
