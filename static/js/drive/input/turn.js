/**
 * The button by which a holder turns the robot around, to see the area behind it before driving there.
 * While it is pressed, it acts as a stick held to the left; the dead-man rule and the gate apply as always.
 */

import { whyNotNow } from "../../control/lease.js";
import { HeldKeys } from "../../hand/held_keys.js";
import { PointerGrip } from "../../hand/pointer_grip.js";
import { dim, mark, show } from "../../lib/dom.js";
import { NEUTRAL } from "./stick.js";

const INPUT = "turn";
const LEFT = Object.freeze({ x: 0, y: 0, w: 1 });
const TAP_MS = 300;

/** Return whether sensors do not see the whole area behind the robot. */
export function reverseIsBlind({ limits = [] }) {
  return limits.some(({ code, way }) => code === "blind_direction" && way === "reverse");
}

/** Return whether reverse is refused, because nothing has looked for table tops behind. */
function behindIsUnseen({ limits = [] }) {
  return limits.some(({ code }) => code === "behind_unseen");
}

export class TurnAndLook {
  #button;
  #stick;
  #hint;
  #may = false;
  #unseen = false;
  #pressedUnseen = false; // reverse was refused when it was pressed
  #offered = false;
  #sinceMs = null; // when it was pressed; null: it is not
  #finger;
  #key; // the space bar stops, so only Enter holds this button
  #leave = () => this.#key.drop("left");

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
    dim(button, true, whyNotNow());
    this.#finger = new PointerGrip(button, {
      begin: (event) => this.#press(event),
      end: (lost, event) => this.#release(lost, event),
      rest: () => stick.feed(INPUT, NEUTRAL),
    });
    this.#key = new HeldKeys(
      button,
      ["Enter"],
      () => true,
      (held, lost, event) => {
        if (held.size > 0) return this.#press(event);
        this.#release(lost, event);
        stick.feed(INPUT, NEUTRAL);
      },
    );
    button.addEventListener("blur", this.#leave);
  }

  /** @param {object} state of the robot */
  set state({ verdict }) {
    this.#unseen = behindIsUnseen(verdict);
    // The button does not disappear while it is pressed.
    if (this.#sinceMs === null) show(this.#button, this.#unseen || reverseIsBlind(verdict));
    // Offered from a pull on until something has looked, or the driver says that he has.
    this.#offered = this.#unseen && (this.#offered || verdict.asked?.[0] < 0);
    mark(this.#button, "offered", this.#offered);
  }

  /** How far to turn, while the button is held and reverse was refused; otherwise empty. */
  get holdText() {
    if (this.#sinceMs === null || !this.#may || !this.#pressedUnseen) return "";
    return this.#unseen
      ? gettext("Hold until reverse is allowed: about half a turn.")
      : gettext("Reverse is allowed now: let go.");
  }

  /** @param {boolean} may whether this tab drives */
  set mayAct(may) {
    this.#may = may;
    dim(this.#button, !may, whyNotNow());
    if (may) return;
    this.#finger.drop("control-ended");
    this.#key.drop("control-ended");
  }

  close() {
    this.#button.removeEventListener("blur", this.#leave);
    this.#finger.close();
    this.#key.close();
  }

  #press({ timeStamp }) {
    this.#sinceMs = timeStamp;
    this.#pressedUnseen = this.#unseen;
    if (this.#may) this.#stick.feed(INPUT, LEFT);
    return true;
  }

  /** @param {?string} lost why the grip ended; null: the hand released it, by this event */
  #release(lost, event) {
    const sinceMs = this.#sinceMs;
    this.#sinceMs = null;
    if (lost && this.#stick.input === INPUT) this.#stick.neutralise(lost);
    if (lost) return;
    const isTap = event.timeStamp - sinceMs < TAP_MS;
    if (isTap || !this.#may) this.#hint(this.#may);
  }
}
