/**
 * A person's choices for driving: speed, sideways as turning or sliding, a sticky stick, side of the stick.
 */

import { number } from "../formats/numbers.js";
import { make, makeButton, mark, setText, show } from "../lib/dom.js";
import { recall, remember } from "../lib/prefs.js";

/** Words for speeds, each with its highest speed in m/s. */
function paces() {
  return [
    [0.25, gettext("very slow")],
    [0.55, gettext("slow")],
    [0.9, gettext("a stroll")],
    [1.6, gettext("walking pace")],
    [Infinity, gettext("faster than walking")],
  ];
}

/** A speed in words. Pure. @param {number} speed m/s */
export function paceText(speed) {
  return paces().find(([upTo]) => speed <= upTo)[1];
}

/** The text of a speed on a button, without a zero at the end: 0.4, 0.25. Pure. @param {number} speed m/s */
export function speedText(speed) {
  const text = number(speed, 2);
  return text.endsWith("0") ? text.slice(0, -1) : text;
}

/** Return the offered speed shares: steps of a fifth, up to the robot's own limit. */
export function sharesUpTo(maxShare) {
  const steps = [0.2, 0.4, 0.6, 0.8, 1].filter((share) => share < maxShare - 1e-6);
  return [...steps, maxShare];
}

/** Return the first share: the largest offered share that is not above the robot's default. */
export function firstShare(shares, defaultShare) {
  return shares.findLast((share) => share <= defaultShare + 1e-6) ?? shares[0];
}

function pressed(button, on) {
  button.setAttribute("aria-pressed", String(on));
}

function isPressed(button) {
  return button.getAttribute("aria-pressed") === "true";
}

/** Events: "share" (detail: number), "sticky", "slides" (detail: boolean). */
export class DrivingOptions extends EventTarget {
  #root;
  #parts;
  #limits = null;
  #facts = null;
  #lessonShare = 1; // largest share in the present lesson
  #share = null;
  #listening = new AbortController();

  /** @param {HTMLElement} root gets data-sides for the style sheet */
  constructor(root, parts) {
    super();
    this.#root = root;
    this.#parts = parts;
    const { signal } = this.#listening;
    parts.swap.addEventListener("click", () => this.#swap(), { signal });
    for (const name of ["sticky", "slides"]) {
      parts[name].addEventListener("click", () => this.#toggle(name), { signal });
    }
    mark(root, "sides", recall("sides", "plain"));
  }

  /** @param {object} facts the robot's facts; the chosen share is kept if the new facts still offer it */
  set facts(facts) {
    const { limits, default_share, max_share, holonomic } = facts;
    this.#facts = facts;
    this.#limits = limits;
    show(this.#parts.slides, holonomic);
    const shares = sharesUpTo(Math.min(max_share, this.#lessonShare));
    const buttons = shares.map((share) => {
      const speed = speedText(share * limits.forward_mps);
      const percent = Math.round(share * 100);
      const unit = make("span", { className: "only-read", text: " m/s, " });
      const children = [speed, unit, make("small", { text: `${percent} %` })];
      return makeButton({ data: { share }, children }, () => this.#pick(share));
    });
    this.#parts.shares.replaceChildren(...buttons);
    this.#pick(shares.includes(this.#share) ? this.#share : firstShare(shares, default_share));
  }

  /** @param {?{max_share: number}} tasks that the present lesson leaves */
  set tasks(tasks) {
    this.#lessonShare = tasks?.max_share ?? 1;
    if (this.#facts) this.facts = this.#facts;
  }

  close() {
    this.#listening.abort();
  }

  #pick(share) {
    this.#share = share;
    for (const button of this.#parts.shares.children) {
      pressed(button, Number(button.dataset.share) === this.#share);
    }
    const speed = this.#share * this.#limits.forward_mps;
    setText(this.#parts.speed, `${number(speed, 2)} m/s`);
    setText(this.#parts.pace, paceText(speed));
    this.#emit("share", this.#share);
  }

  #toggle(name) {
    const on = !isPressed(this.#parts[name]);
    pressed(this.#parts[name], on);
    this.#emit(name, on);
  }

  #swap() {
    const sides = this.#root.dataset.sides === "plain" ? "swapped" : "plain";
    mark(this.#root, "sides", sides);
    remember("sides", sides);
  }

  #emit(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}
