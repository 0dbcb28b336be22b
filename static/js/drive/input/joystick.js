/** The joystick on the page: nipplejs draws it and follows the finger, this module feeds the stick. */

import { create, factory } from "../../../vendor/nipplejs/index.mjs";
import { fromJoystick } from "./shaping.js";
import { NEUTRAL } from "./stick.js";

export const STICKY_MS = 30_000;

const RING = 0.72; // share of the zone: the knob stays within the zone at full stick

/**
 * Events: "released" when a held stick went back to the middle by itself (detail: {reason}).
 * Sticky: the stick stays where the finger left it, until it is touched, something else stops it, or 30 s
 * pass.
 */
export class Joystick extends EventTarget {
  #zone;
  #stick;
  #collection = null;
  #observer;
  #size = 0;
  #touched = false;
  #held = false;
  #timer = null;
  #sticky = false;
  #slides = false;
  #onChange = ({ detail }) => this.#follow(detail);
  // The zone may have moved on the page: without this, nipplejs measures from the old middle.
  #onPress = () => this.#collection?.reposition();
  #onZero = ({ detail }) => this.#letGo(detail.reason);

  /** @param {HTMLElement} zone @param {import("./stick.js").Stick} stick */
  constructor(zone, stick) {
    super();
    this.#zone = zone;
    this.#stick = stick;
    this.#stick.addEventListener("zero", this.#onZero);
    this.#stick.addEventListener("change", this.#onChange);
    zone.addEventListener("pointerdown", this.#onPress, { capture: true });
    this.#observer = new ResizeObserver(() => this.#fit());
    this.#observer.observe(zone);
  }

  set sticky(on) {
    this.#sticky = on;
    if (!on) this.#letGo("unstuck");
  }

  /** Whether sideways means sliding and not turning. */
  set slides(on) {
    this.#slides = on;
    this.#stick.neutralise("input-changed");
  }

  /** Return whether the joystick is visible: some tabs do not show it. */
  get isShown() {
    return this.#zone.clientWidth > 0;
  }

  /** Return whether the stick is held out of the middle without a finger on it. */
  get sticks() {
    return this.#held;
  }

  close() {
    this.#observer.disconnect();
    this.#zone.removeEventListener("pointerdown", this.#onPress, { capture: true });
    this.#stick.removeEventListener("zero", this.#onZero);
    this.#stick.removeEventListener("change", this.#onChange);
    this.#letGo("closed");
    this.#collection?.destroy();
    factory.destroy();
  }

  /** Make a new joystick when the zone's size changes: nipplejs works with fixed pixels. */
  #fit() {
    const size = Math.round(Math.min(this.#zone.clientWidth, this.#zone.clientHeight));
    if (size === this.#size || size === 0) return;
    this.#size = size;
    this.#touched = false;
    this.#letGo("resized");
    this.#collection?.destroy();
    this.#collection = create({
      zone: this.#zone,
      mode: "static",
      position: { left: "50%", top: "50%" },
      size: size * RING,
      color: { front: "var(--stick-knob)", back: "transparent" },
      restOpacity: 1,
      fadeTime: 100,
    });
    this.#collection.on("start", () => this.#touch());
    this.#collection.on("move", ({ data }) => this.#move(data.vector));
    this.#collection.on("end", () => this.#release());
  }

  #touch() {
    this.#touched = true;
    this.#held = false;
    clearTimeout(this.#timer);
  }

  #move({ x: right, y: up }) {
    if (!this.#touched) return;
    this.#stick.feed("joystick", fromJoystick({ right, up }, this.#slides));
  }

  /** Move the knob with the stick while keys, a gamepad or a button move it. */
  #follow({ axes, input }) {
    if (input === "joystick" || this.#touched || this.#held || !this.#collection) return;
    const [right, down] = [-(axes.w || axes.y), -axes.x];
    const reach = (0.5 * RING * this.#size) / Math.max(Math.hypot(right, down), 1);
    const [x, y] = [right * reach, down * reach];
    const { frontPosition: now } = this.#knob;
    if (x !== now.x || y !== now.y) this.#knob.setPosition(undefined, { x, y });
  }

  #release() {
    this.#touched = false;
    if (this.#sticky && this.#stick.input === "joystick") {
      this.#held = true;
      this.#knob.options.restJoystick = false;
      this.#timer = setTimeout(() => this.#letGo("untouched"), STICKY_MS);
    } else {
      this.#stick.feed("joystick", NEUTRAL);
    }
  }

  /**
   * Release a held stick. After a zero or a resize, a finger that is still down is ignored until it lifts.
   */
  #letGo(reason) {
    clearTimeout(this.#timer);
    if (!this.#touched) this.#stick.feed("joystick", NEUTRAL);
    if (!this.#held) return;
    this.#held = false;
    this.#knob.options.restJoystick = true;
    this.#knob.setPosition(undefined, { x: 0, y: 0 });
    this.dispatchEvent(new CustomEvent("released", { detail: { reason } }));
  }

  get #knob() {
    return this.#collection.all.values().next().value;
  }
}
