/**
 * One stick, many inputs. Joystick, keyboard and gamepad all feed this arbiter; at most one of them
 * is active at a time. It uses no DOM and no clock.
 *
 * Axes go from -1 to 1: `x` forward, `y` left (holonomic bases), `w` turn left.
 */

export const NEUTRAL = Object.freeze({ x: 0, y: 0, w: 0 });

export function isNeutral(axes) {
  return axes.x === 0 && axes.y === 0 && axes.w === 0;
}

/**
 * Events: "change" (detail: {axes, input}) when the stick moved; "zero" (detail: {reason, input}) when
 * it was set to neutral by something other than its own input.
 */
export class Stick extends EventTarget {
  #axes = NEUTRAL;
  #input = null;
  #blocked = new Set();

  get axes() {
    return this.#axes;
  }

  /** The input that drives now, or null. */
  get input() {
    return this.#input;
  }

  /** Return whether an input is ignored because it has not been back in neutral yet. */
  get waitsForNeutral() {
    return this.#blocked.size > 0;
  }

  /** Set an input's current position. */
  feed(input, axes) {
    const neutral = isNeutral(axes);
    if (this.#blocked.has(input)) {
      if (neutral) this.#unblock(input);
      return;
    }
    if (this.#input === input) this.#set(neutral ? null : input, neutral ? NEUTRAL : axes);
    else if (neutral) return;
    else if (this.#input === null) this.#set(input, axes);
    else this.#collide(input);
  }

  /** Set the stick to neutral at once; the active input is ignored until it has been in neutral itself. */
  neutralise(reason) {
    const input = this.#input;
    if (input === null) return;
    this.#blocked.add(input);
    this.#set(null, NEUTRAL);
    this.#emit("zero", { reason, input });
  }

  /** A second input moved while the first drives: both are ignored until each has been in neutral. */
  #collide(input) {
    this.#blocked.add(input);
    this.neutralise("input-changed");
  }

  #unblock(input) {
    this.#blocked.delete(input);
    this.#emit("change", { axes: this.#axes, input: this.#input });
  }

  #set(input, axes) {
    this.#input = input;
    this.#axes = axes;
    this.#emit("change", { axes, input });
  }

  #emit(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}
