/**
 * Velocities that this page repeats: the robot's bridge refuses a velocity older than a third of a second.
 */

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
    this.#timers.set(request.topic, { request, rateHz: pace, timer });
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
      clearInterval(this.#timers.get(key).timer);
      this.#timers.delete(key);
    }
    return ending.length > 0;
  }
}
