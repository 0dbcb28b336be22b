/**
 * The drawer "Robot": moves the arm home, gripper and torso. A slider sends one bounded goal when it is
 * released, so that no motion goes on without an end.
 */

import { whyNotNow } from "../control/lease.js";
import { hand } from "../hand/watch.js";
import { dim, setText, show } from "../lib/dom.js";
import { NewEnds } from "../tasks/task_ends.js";
import { centimetres, endNotice, limbName, movesOf, movingText } from "./words.js";

const HOME = "home"; // the motion that brings the arm home
const PRIMARY = 1; // in `buttons`: the main button alone, a finger, the tip of a pen
const KEYS_REST_MS = 400; // after the last press of an arrow key on a slider

export class LimbPanel {
  static hears = ["facts", "offers", "state.limbs", "mayAct"];
  static task = "limbs";
  static requests = {
    move_limb: { name: ({ limb }) => limbName(limb) },
    limb_cancel: { name: () => gettext("Cancel the move of gripper or torso"), ends: true },
  };
  #parts;
  #request;
  #ranges = {};
  #home = null;
  #grips = new Map(); // by limbs whose slider is under a finger
  #limbs = {}; // as the robot last reported
  #held = new Set(); // limbs whose slider is under a finger or moved by arrow keys
  #left = new Set(); // limbs whose slider was under a finger that was lost: its end counts no more
  #timers = {};
  #ends;
  #listening = new AbortController();

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ parts, request, notify }) {
    this.#parts = parts;
    this.#request = request;
    this.#ends = new NewEnds((ended, limb) => {
      const notice = endNotice(limb, ended);
      if (notice) notify(notice);
    });
    const { signal } = this.#listening;
    const on = (part, type, act) => parts[part].addEventListener(type, act, { signal });
    on("arm-home", "click", () => request({ t: "play", motion: HOME, title: this.#home?.title }));
    on("gripper-open", "click", () => this.#move("gripper", this.#ranges.gripper.most_m));
    on("gripper-close", "click", () => this.#move("gripper", this.#ranges.gripper.least_m));
    for (const limb of ["gripper", "torso"]) {
      on(`${limb}-to`, "pointerdown", (event) => event.button === 0 && this.#press(limb, event));
      on(`${limb}-to`, "contextmenu", (event) => {
        if (event.pointerType === "touch") event.preventDefault(); // a long touch holds the slider
      });
      on(`${limb}-to`, "input", () => this.#slid(limb));
      on(`${limb}-to`, "change", (event) => this.#released(limb, event.target));
    }
    for (const type of ["pointermove", "pointerup", "pointercancel"])
      window.addEventListener(type, (event) => this.#judge(event), { signal, capture: true });
    const leave = () => {
      for (const limb of [...this.#held]) this.#leave(limb);
    };
    hand.addEventListener("interrupted", leave, { signal });
    this.mayAct = false;
  }

  /** @param {object} facts of the robot */
  set facts({ limbs = {}, has_head: hasHead = false }) {
    this.#ranges = limbs;
    for (const limb of ["gripper", "torso"]) {
      const range = limbs[limb];
      show(this.#parts[`${limb}-row`], range !== undefined);
      if (!range) continue;
      const slider = this.#parts[`${limb}-to`];
      slider.min = range.least_m;
      slider.max = range.most_m;
      slider.step = 0.005;
    }
    show(this.#parts["head-open"], hasHead);
    this.#showOpener();
  }

  /** @param {object} offers of the robot */
  set offers({ motions = [] }) {
    this.#home = motions.find(({ name }) => name === HOME) ?? null;
    show(this.#parts["arm-home"], this.#home !== null);
    this.#showOpener();
  }

  /** @param {object} limbs of the robot's state */
  set limbs(limbs) {
    this.#limbs = limbs;
    for (const limb of Object.keys(limbs))
      if (this.#ranges[limb] && !this.#held.has(limb)) this.#follow(limb);
    const ends = Object.entries(limbs).map(([limb, { ended = null }]) => [limb, ended]);
    this.#ends.follow(Object.fromEntries(ends));
  }

  shows(limbs) {
    const moving = movesOf(limbs);
    if (moving.length === 0) return null;
    const cancel = moving.map(([limb]) => ({ t: "limb_cancel", limb }));
    return { words: movingText(limbs), who: moving[0][1].who, cancel };
  }

  /** @param {boolean} may whether this tab has control */
  set mayAct(may) {
    for (const part of ["arm-home", "gripper-open", "gripper-close", "gripper-to", "torso-to"])
      dim(this.#parts[part], !may, whyNotNow());
  }

  close() {
    this.#listening.abort();
    for (const limb of [...this.#held]) this.#letGo(limb);
    for (const timer of Object.values(this.#timers)) clearTimeout(timer);
  }

  #showOpener() {
    const any = Object.keys(this.#ranges).length > 0 || this.#home !== null;
    show(this.#parts["robot-open"], any);
  }

  /** Show the limb as the robot last reported. */
  #follow(limb) {
    const { at_m: atM = null, to_m: toM = null } = this.#limbs[limb] ?? {};
    if (atM !== null) this.#parts[`${limb}-to`].value = toM ?? atM;
    this.#label(limb, atM);
  }

  #label(limb, metres) {
    const text = metres === null ? gettext("unknown") : centimetres(metres);
    setText(this.#parts[`${limb}-at`], text);
    this.#parts[`${limb}-to`].setAttribute("aria-valuetext", text);
  }

  #press(limb, { pointerId }) {
    this.#letGo(limb);
    this.#left.delete(limb);
    this.#held.add(limb);
    const grip = { pointerId, lifted: false, lose: () => this.#leave(limb) };
    this.#grips.set(limb, grip);
    hand.begin(grip, Infinity); // a finger that rests sends nothing to the robot
  }

  /** Each pointer event says which buttons are down now: after a menu, a page hears of no release. */
  #judge({ type, pointerId, buttons }) {
    for (const [limb, grip] of this.#grips) {
      if (grip.pointerId !== pointerId) continue;
      grip.lifted = type === "pointerup"; // `change` follows at once
      if (grip.lifted) setTimeout(() => this.#letGo(limb));
      else if (type === "pointercancel") hand.lose(grip, "taken");
      else if (buttons !== PRIMARY) hand.lose(grip, "button");
    }
  }

  #slid(limb) {
    clearTimeout(this.#timers[limb]);
    this.#label(limb, Number(this.#parts[`${limb}-to`].value));
  }

  /** Send the goal: at once after a finger, after a pause for arrow keys, because each press is a change. */
  #released(limb, slider) {
    const to = Number(slider.value);
    clearTimeout(this.#timers[limb]);
    const grip = this.#grips.get(limb);
    // Chromium ends a drag, before its `blur`, when something takes the focus from the window.
    if (grip && !grip.lifted) return hand.lose(grip, "taken");
    if (this.#left.delete(limb)) return this.#follow(limb);
    if (grip) {
      slider.blur(); // keys drive the base again
      this.#move(limb, to);
      return;
    }
    this.#held.add(limb);
    this.#timers[limb] = setTimeout(() => this.#move(limb, to), KEYS_REST_MS);
  }

  /** The hand or the page was lost while a slider was held: the limb stays where it is. */
  #leave(limb) {
    if (this.#grips.has(limb)) this.#left.add(limb);
    clearTimeout(this.#timers[limb]);
    this.#letGo(limb);
    this.#follow(limb);
  }

  async #move(limb, to) {
    this.#letGo(limb);
    const goal = { t: "move_limb", limb, to_m: Math.round(to * 1000) / 1000, quiet: true };
    const refusal = await this.#request(goal);
    if (refusal && !this.#held.has(limb)) this.#follow(limb);
  }

  #letGo(limb) {
    hand.end(this.#grips.get(limb));
    this.#grips.delete(limb);
    this.#held.delete(limb);
  }
}
