/** Times of sending the stick: often out of neutral, seldom at rest, never while the network is full. */

import { isNeutral, NEUTRAL } from "./input/stick.js";

const DRIVING_MS = 1000 / 30;
const RESTING_MS = 200;
const TIMER_SLACK_MS = 4; // timers come a little early or late; half a period would halve the rate

/**
 * Return whether the stick should be sent now.
 * @param {{neutral: boolean, sinceLastMs: number, backlog: number}} moment `backlog`: bytes the network has not taken
 */
export function isDue({ neutral, sinceLastMs, backlog }) {
  if (backlog > 0) return false; // the newest will go when there is room
  return sinceLastMs >= (neutral ? RESTING_MS : DRIVING_MS) - TIMER_SLACK_MS;
}

/** Sends a stick over a socket under a fence; runs only while its page has control. */
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
   * @param {{send: (message: object) => boolean, backlog: number}} socket
   * @param {import("./input/stick.js").Stick} stick
   * @param {() => number} clock milliseconds, growing over reloads of the tab
   */
  constructor(socket, stick, clock) {
    this.#socket = socket;
    this.#stick = stick;
    this.#clock = clock;
    this.#seq = Math.floor(clock()); // far fewer than one message per millisecond: it grows over reloads
  }

  /** The share of the robot's limits that a full stick means. */
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
    // The last zero is what stops the robot: it is never left to the next tick.
    if (this.#moving && isNeutral(this.#stick.axes)) this.zero();
    else this.#tick();
  }

  #tick() {
    const { axes } = this.#stick;
    const sinceLastMs = this.#clock() - this.#lastMs;
    if (isDue({ neutral: isNeutral(axes), sinceLastMs, backlog: this.#socket.backlog }))
      this.#send(axes);
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
