/**
 * The button by which a holder turns the robot around, to see the area behind it before driving there.
 * While it is pressed, it acts as a stick held to the left; the dead-man rule and the gate apply as always.
 */

import { takeControlFirst } from "../../control/lease.js";
import { dim, show } from "../../lib/dom.js";
import { NEUTRAL } from "./stick.js";

const INPUT = "turn";
const LEFT = Object.freeze({ x: 0, y: 0, w: 1 });
const TAP_MS = 300;

/** Return whether sensors do not see the whole area behind the robot. */
export function reverseIsBlind({ limits = [] }) {
  return limits.some(({ code, way }) => code === "blind_direction" && way === "reverse");
}

export class TurnAndLook {
  #button;
  #stick;
  #hint;
  #may = false;
  #sinceMs = null; // when it was pressed; null: it is not
  #listening = new AbortController();

  /**
   * @param {HTMLButtonElement} button
   * @param {import("./stick.js").Stick} stick
   * @param {(may: boolean) => void} hint is called when a press was only a tap, or when this tab may not
   *   drive
   */
  constructor(button, stick, hint) {
    this.#button = button;
    this.#stick = stick;
    this.#hint = hint;
    dim(button, true, takeControlFirst());
    const { signal } = this.#listening;
    const on = (type, act) => button.addEventListener(type, act, { signal });
    on("pointerdown", (event) => {
      if (event.button) return;
      button.setPointerCapture?.(event.pointerId);
      this.#press(event);
    });
    for (const type of ["pointerup", "pointercancel", "lostpointercapture", "keyup", "blur"])
      on(type, (event) => this.#release(event));
    on("keydown", (event) => {
      if (event.code !== "Enter") return; // the space bar stops
      event.preventDefault();
      if (!event.repeat) this.#press(event);
    });
    on("contextmenu", (event) => event.preventDefault()); // a long touch would open a menu
  }

  /** @param {object} state of the robot */
  set state({ verdict }) {
    // The button does not disappear while it is pressed.
    if (this.#sinceMs === null) show(this.#button, reverseIsBlind(verdict));
  }

  /** @param {boolean} may whether this tab drives */
  set mayAct(may) {
    this.#may = may;
    dim(this.#button, !may, takeControlFirst());
    if (!may) this.#stick.feed(INPUT, NEUTRAL);
  }

  close() {
    this.#listening.abort();
    this.#stick.feed(INPUT, NEUTRAL);
  }

  #press({ timeStamp }) {
    this.#sinceMs = timeStamp;
    if (this.#may) this.#stick.feed(INPUT, LEFT);
  }

  #release({ timeStamp }) {
    if (this.#sinceMs === null) return;
    const heldMs = timeStamp - this.#sinceMs;
    this.#sinceMs = null;
    this.#stick.feed(INPUT, NEUTRAL);
    if (heldMs < TAP_MS || !this.#may) this.#hint(this.#may);
  }
}
