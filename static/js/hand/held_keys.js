/**
 * Keys that move something while they are held. A key counts by its position, not by its letter.
 *
 * Each key is a grip of its own: its release may be lost while another key is held. Its own repeats prove it, and each
 * press or release of a key of the set: a hand that steers is there. When one grip ends without the hand, all keys of the set end with it, and each must be pressed again.
 */

import { isEditing } from "../lib/editing.js";
import { hand, isComposing, isModified } from "./watch.js";

export class HeldKeys {
  #grips = new Map(); // by the codes of the held keys
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
    for (const grip of this.#grips.values()) hand.lose(grip, reason); // the first one clears them all
  }

  close() {
    this.drop("closed");
    this.#listening.abort();
  }

  #down(event, may) {
    if (isEditing(event.target) || isModified(event) || isComposing(event)) return;
    const moves = this.#codes.has(event.code) && may();
    if (!event.repeat) this.#endRepeats(moves); // only the newest key repeats, also if it moves nothing
    if (!moves) return;
    event.preventDefault();
    const held = this.#grips.get(event.code);
    if (held) return hand.prove(held, event);
    // A repeat: it was held when input ended, and must be pressed again.
    if (event.repeat || !hand.admit()) return;
    const grip = { lose: (reason) => this.#lose(reason), usesKeys: true };
    this.#grips.set(event.code, grip);
    hand.begin(grip);
    this.#tell(null, event);
  }

  #up(event) {
    const grip = this.#grips.get(event.code);
    if (!grip) return;
    this.#grips.delete(event.code);
    hand.end(grip);
    this.#endRepeats(true);
    this.#tell(null, event);
  }

  #lose(reason) {
    for (const grip of this.#grips.values()) hand.end(grip);
    this.#grips.clear();
    this.#tell(reason, null);
  }

  #endRepeats(proves) {
    for (const grip of this.#grips.values()) proves ? hand.prove(grip) : hand.expectNoRepeat(grip);
  }

  #tell(lost, event) {
    this.#changed(new Set(this.#grips.keys()), lost, event);
  }
}
