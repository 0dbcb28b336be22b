/**
 * Velocities that this page repeats: the robot's bridge refuses a velocity older than a third of a second.
 */

import { WITHOUT_HAND_MS } from "../hand/proof.js";
import { hand } from "../hand/watch.js";

const SLOWEST_HZ = 5; // at a lower rate, the base would stop between two velocities

export class Repeater {
  #send;
  #timers = new Map();

  /** @param {(request: object) => void} send */
  constructor(send) {
    this.#send = send;
  }

  /** @returns {{topic, type, rate_hz}[]} the topics with repeated velocities */
  get running() {
    return [...this.#timers.values()].map(({ request: { topic, type }, rateHz }) => ({
      topic,
      type,
      rate_hz: rateHz,
    }));
  }

  begin(request, rateHz) {
    this.end(request.topic);
    const pace = Math.max(rateHz, SLOWEST_HZ);
    this.#anew(request);
    const timer = setInterval(() => this.#send({ ...request, quiet: true }), 1000 / pace);
    const lose = () => this.end(request.topic);
    const repeated = { request, rateHz: pace, timer, withoutHand: true, lose };
    this.#timers.set(request.topic, repeated);
    hand.begin(repeated, WITHOUT_HAND_MS);
  }

  once(request) {
    this.end(request.topic);
    this.#anew(request);
  }

  /** Send zero, then the velocity: it begins like a stick in the middle, independent of earlier messages. */
  #anew(request) {
    this.#send({ ...request, fields: {}, quiet: true });
    this.#send(request);
  }

  /** @param {?string} topic null: all topics. @returns {boolean} whether a repetition ended */
  end(topic = null) {
    const ending = [...this.#timers.keys()].filter((key) => topic === null || key === topic);
    for (const key of ending) {
      const repeated = this.#timers.get(key);
      clearInterval(repeated.timer);
      hand.end(repeated);
      this.#timers.delete(key);
    }
    return ending.length > 0;
  }
}
