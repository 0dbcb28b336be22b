/**
 * The second stick: it pans and tilts the robot's head while it is held: by finger, mouse or the keys IJKL.
 *
 * Each request turns the head by a bounded angle and takes 0.2 s. When input ends, no further request is
 * sent: the head stands within 0.3 s. At most two requests wait for an answer, so that they do not pile up in
 * a slow network.
 */

import { whyNotNow } from "../control/lease.js";
import { HeldKeys } from "../hand/held_keys.js";
import { PointerGrip } from "../hand/pointer_grip.js";
import { hand, isModified } from "../hand/watch.js";
import { dim, mark, show } from "../lib/dom.js";
import { isEditing } from "../lib/editing.js";

const PERIOD_MS = 150;
const FASTEST_RADPS = 0.9;
const MOST_WAITING = 2; // requests without an answer
const REST = 0.12; // smaller deflections count as the middle
const KEYS = { KeyI: [0, 1], KeyK: [0, -1], KeyJ: [1, 0], KeyL: [-1, 0] };
const AHEAD = "KeyO";
const AHEAD_BUTTONS = ["head-ahead", "look-ahead"]; // beside the stick, in the drawer "More"

/** Return the share of the fastest turn for a deflection from -1 to 1: fine near the middle. Pure. */
export function shaped(deflection) {
  const size = Math.min(Math.abs(deflection), 1);
  if (size < REST) return 0;
  return Math.sign(deflection) * ((size - REST) / (1 - REST)) ** 2;
}

export class HeadStick {
  static hears = ["facts", "mayAct", "fence", "state.head_follows"];
  static requests = {
    look_ahead: {
      name: () => gettext("Look ahead"),
      done: () => gettext("The head turns to where the robot drives."),
    },
    turn_head: { name: () => gettext("Turn the head") },
  };
  #pad;
  #knob;
  #request;
  #notify;
  #may = false;
  #saidThatItFollows = false;
  #hasHead = false;
  #finger;
  #keys;
  #way = { pan: 0, tilt: 0 }; // -1 to 1; positive: left, up
  #waiting = 0;
  #timer = null;
  #parts;
  #listening = new AbortController();

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ parts, request, steers, notify }) {
    this.#parts = parts;
    this.#notify = notify;
    this.#pad = parts["head-pad"];
    this.#knob = parts["head-knob"];
    this.#request = request;
    const { signal } = this.#listening;
    const on = (target, type, act) => target.addEventListener(type, act, { signal });
    on(parts["head-open"], "click", () => this.#open(parts["head-box"].hidden));
    for (const part of AHEAD_BUTTONS) on(parts[part], "click", () => this.#ahead());
    on(window, "keydown", (event) => steers() && this.#key(event));
    this.#finger = new PointerGrip(this.#pad, {
      begin: () => this.#begin(),
      move: (event) => this.#drag(event),
      end: () => this.#turn(0, 0),
    });
    const may = () => steers() && this.#may && this.#hasHead && !this.#finger.isHeld;
    this.#keys = new HeldKeys(window, Object.keys(KEYS), may, (held) => this.#byKeys(held));
    this.mayAct = false;
  }

  /** @param {object} facts of the robot */
  set facts({ has_head: hasHead = false }) {
    this.#hasHead = hasHead;
    show(this.#parts["look-ahead"], hasHead);
    if (!hasHead) this.zero();
  }

  /** @param {boolean} may whether this tab has control of a robot */
  set mayAct(may) {
    this.#may = may;
    for (const part of AHEAD_BUTTONS) dim(this.#parts[part], !may, whyNotNow());
    mark(this.#pad, "idle", !may);
    if (!may) this.zero();
  }

  /** @param {?number} fence of this tab's control; null: it has none */
  set fence(fence) {
    if (fence === null) this.#saidThatItFollows = false;
  }

  /** @param {boolean} follows the head turned by itself in this control; heard with each state, said once */
  set head_follows(follows) {
    if (!follows || !this.#may || this.#saidThatItFollows) return;
    this.#saidThatItFollows = true;
    const text = gettext(
      "The head looks by itself to where the robot drives: its camera sees obstacles.",
    );
    this.#notify({ level: "info", code: "head follows", text });
  }

  /** End input now, also if a finger or a key is still held. */
  zero() {
    this.#finger.drop("released");
    this.#keys.drop("released");
  }

  close() {
    this.#finger.close();
    this.#keys.close();
    this.#listening.abort();
  }

  #open(opens) {
    show(this.#parts["head-box"], opens);
    this.#parts["head-open"].setAttribute("aria-pressed", String(opens));
    if (!opens) this.zero();
  }

  #ahead() {
    this.zero();
    this.#request({ t: "look_ahead" });
  }

  #begin() {
    if (this.#may) this.#keys.drop("input-changed");
    return this.#may;
  }

  #drag({ clientX, clientY }) {
    const { left, top, width, height } = this.#pad.getBoundingClientRect();
    if (width === 0) return this.zero(); // something hides the pad
    const right = (2 * (clientX - left)) / width - 1;
    const down = (2 * (clientY - top)) / height - 1;
    const size = Math.max(1, Math.hypot(right, down));
    this.#turn(-right / size, -down / size);
  }

  #key(event) {
    if (isEditing(event.target) || isModified(event) || event.repeat) return;
    if (event.code !== AHEAD || !this.#hasHead || !this.#may) return;
    if (hand.admit()) this.#ahead();
  }

  #byKeys(held) {
    const sum = [0, 0];
    for (const code of held) for (const axis of [0, 1]) sum[axis] += KEYS[code][axis];
    this.#turn(0.8 * sum[0], 0.8 * sum[1]);
  }

  #turn(pan, tilt) {
    this.#way = { pan, tilt };
    this.#knob.style.setProperty("--right", String(-pan));
    this.#knob.style.setProperty("--down", String(-tilt));
    if (pan === 0 && tilt === 0) {
      clearInterval(this.#timer);
      this.#timer = null;
    } else if (this.#timer === null) {
      this.#timer = setInterval(() => this.#step(), PERIOD_MS);
      this.#step();
    }
  }

  async #step() {
    const most = (FASTEST_RADPS * PERIOD_MS) / 1000;
    const pan = shaped(this.#way.pan) * most;
    const tilt = shaped(this.#way.tilt) * most;
    if (this.#waiting >= MOST_WAITING || (pan === 0 && tilt === 0)) return;
    this.#waiting += 1;
    const refusal = await this.#request({ t: "turn_head", pan, tilt, quiet: true });
    this.#waiting -= 1;
    if (refusal) this.zero(); // the next request would be refused, too
  }
}
