/** When to send the stick: 30 times a second while it is moved, 5 at rest, never while older bytes wait. */

import { isNeutral, NEUTRAL } from "./input/stick.js";

const DRIVING_MS = 1000 / 30;
const RESTING_MS = 200;
// Timers fire a little early or late; without slack, an early tick sends nothing and the rate halves.
const TIMER_SLACK_MS = 4;

/**
 * Return whether it is time to send the stick.
 * @param {{neutral: boolean, sinceLastMs: number}} moment
 */
export function isDue({ neutral, sinceLastMs }) {
  return sinceLastMs >= (neutral ? RESTING_MS : DRIVING_MS) - TIMER_SLACK_MS;
}

/** Sends the stick and the lease's fence over a socket. Runs only while the page has control. */
export class DriveSender {
  #socket;
  #stick;
  #clock;
  #seq;
  #lastMs = -Infinity;
  #timer = null;
  #fence = null;
  #share = 0.4;
  #moving = false;
  #changed = () => this.#onChange();

  /**
   * @param {{send: (message: object) => boolean, takeBacklog: () => number}} socket
   * @param {import("./input/stick.js").Stick} stick
   * @param {() => number} clock milliseconds; a reload of the tab does not set it back
   */
  constructor(socket, stick, clock) {
    this.#socket = socket;
    this.#stick = stick;
    this.#clock = clock;
    // The numbers begin at the clock's milliseconds. There are far fewer messages than milliseconds: after a
    // reload, the numbers are still larger than before.
    this.#seq = Math.floor(clock());
  }

  /** The share of the robot's speed limits that full stick gives. */
  set share(value) {
    this.#share = value;
  }

  start(fence) {
    if (this.#fence === fence) return;
    this.stop();
    this.#fence = fence;
    this.#stick.addEventListener("change", this.#changed);
    this.#timer = setInterval(() => this.#tick(), DRIVING_MS);
  }

  stop() {
    clearInterval(this.#timer);
    this.#stick.removeEventListener("change", this.#changed);
    this.#fence = null;
    this.#moving = false;
  }

  /** Send zero now, even if the network is full. */
  zero() {
    if (this.#fence !== null) this.#send(NEUTRAL);
  }

  #onChange() {
    // The last zero stops the robot: send it now, not at the next tick.
    if (this.#moving && isNeutral(this.#stick.axes)) this.zero();
    else this.#tick();
  }

  #tick() {
    const { axes } = this.#stick;
    const sinceLastMs = this.#clock() - this.#lastMs;
    if (!isDue({ neutral: isNeutral(axes), sinceLastMs })) return;
    if (this.#socket.takeBacklog() === 0) this.#send(axes); // else the newest position follows when no bytes wait
  }

  #send(axes) {
    const sentMs = this.#clock();
    const { x, y, w } = axes;
    const message = {
      t: "drive",
      fence: this.#fence,
      seq: this.#seq + 1,
      sent_ms: sentMs,
      x,
      y,
      w,
      share: this.#share,
    };
    if (!this.#socket.send(message)) return;
    this.#seq += 1;
    this.#lastMs = sentMs;
    this.#moving = !isNeutral(axes);
  }
}
