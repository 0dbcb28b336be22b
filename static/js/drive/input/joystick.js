/** The joystick on the page: its knob follows the finger, and it feeds the stick. */

import { PointerGrip } from "../../hand/pointer_grip.js";
import { WITHOUT_HAND_MS } from "../../hand/proof.js";
import { hand } from "../../hand/watch.js";
import { make, mark } from "../../lib/dom.js";
import { fromJoystick } from "./shaping.js";
import { NEUTRAL } from "./stick.js";

const INPUT = "joystick";
const REACH = 0.36; // share of the zone from its middle to full stick: the knob stays within the zone

/**
 * Sticky: the stick stays where the finger left it, until it is touched, something else stops it, or 30 s pass.
 */
export class Joystick {
  #zone;
  #stick;
  #knob = make("div", { className: "knob" });
  #finger;
  #observer;
  #sticky = false;
  #stuck = null; // the grip of a stick that stays without a finger
  #slides = false;
  #onPress = ({ button }) => button > 0 && this.#letGo("button");
  #onChange = ({ detail }) => this.#follow(detail);
  #onZero = ({ detail }) => this.#letGo(detail.reason);

  /** @param {HTMLElement} zone @param {import("./stick.js").Stick} stick */
  constructor(zone, stick) {
    this.#zone = zone;
    this.#stick = stick;
    zone.append(this.#knob);
    this.#finger = new PointerGrip(zone, {
      begin: () => this.#touch(),
      move: (event) => this.#move(event),
      end: (reason) => this.#end(reason),
      rest: () => !this.sticks && stick.feed(INPUT, NEUTRAL),
    });
    zone.addEventListener("pointerdown", this.#onPress);
    this.#stick.addEventListener("zero", this.#onZero);
    this.#stick.addEventListener("change", this.#onChange);
    // The same finger would mean another position.
    this.#observer = new ResizeObserver(() => this.#letGo("resized"));
    this.#observer.observe(zone);
  }

  set sticky(on) {
    this.#sticky = on;
    if (!on && this.sticks) this.#letGo("unstuck");
  }

  /** Whether sideways means sliding and not turning. */
  set slides(on) {
    this.#slides = on;
    this.#stick.neutralise("input-changed");
  }

  /** Return whether the stick is held out of the middle without a finger on it. */
  get sticks() {
    return this.#stuck !== null;
  }

  close() {
    this.#observer.disconnect();
    this.#letGo("closed");
    this.#zone.removeEventListener("pointerdown", this.#onPress);
    this.#stick.removeEventListener("zero", this.#onZero);
    this.#stick.removeEventListener("change", this.#onChange);
    this.#finger.close();
    this.#knob.remove();
  }

  #touch() {
    this.#endStuck();
    mark(this.#zone, "held", true);
    return true;
  }

  #move({ clientX, clientY }) {
    const { left, top, width, height } = this.#zone.getBoundingClientRect();
    const reach = REACH * Math.min(width, height);
    if (reach === 0) return this.#letGo("resized"); // something hides the joystick
    const right = (clientX - left - width / 2) / reach;
    const up = (top + height / 2 - clientY) / reach;
    const size = Math.max(1, Math.hypot(right, up));
    this.#place(right / size, -up / size);
    this.#stick.feed(INPUT, fromJoystick({ right: right / size, up: up / size }, this.#slides));
  }

  /** Only a finger that lifts leaves the stick where it is: any other end is no wish to drive on. */
  #end(reason) {
    mark(this.#zone, "held", false);
    if (reason === null && this.#sticky && this.#stick.input === INPUT) {
      this.#stuck = { lose: (why) => this.#unstick(why), withoutHand: true };
      hand.begin(this.#stuck, WITHOUT_HAND_MS);
    } else if (reason !== null) {
      this.#lose(reason);
    } else {
      this.#place(0, 0);
    }
  }

  #lose(reason) {
    this.#place(0, 0);
    if (this.#stick.input === INPUT) this.#stick.neutralise(reason);
  }

  #unstick(reason) {
    this.#stuck = null;
    this.#lose(reason);
    this.#stick.feed(INPUT, NEUTRAL);
  }

  /** Move the knob with the stick while keys, a gamepad or a button move it. */
  #follow({ axes, input }) {
    if (input === INPUT || this.#finger.isHeld || this.sticks) return;
    const [right, down] = [-(axes.w || axes.y), -axes.x];
    const size = Math.max(1, Math.hypot(right, down));
    this.#place(right / size, down / size);
  }

  #place(right, down) {
    this.#knob.style.setProperty("--right", String(right));
    this.#knob.style.setProperty("--down", String(down));
  }

  #endStuck() {
    if (!this.sticks) return;
    hand.end(this.#stuck);
    this.#stuck = null;
  }

  /** End what holds the stick. A finger that is still down is ignored until it lifts. */
  #letGo(reason) {
    this.#finger.drop(reason);
    if (this.#stuck) hand.lose(this.#stuck, reason);
  }
}
