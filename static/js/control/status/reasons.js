/** Why the robot was slow or stood: shown for some seconds after the stick is released; a list has five. */

const LINGERS_MS = 5000;
const KEPT = 5;

/** Collects the gate's interventions. Pure: the time comes from outside. */
export class Reasons {
  #list = [];
  #seenMs = -Infinity;

  /**
   * @param {{code: string, side?: ?string, sensor?: ?string, allowed: number[]}} verdict the newest
   * @param {string} text of its intervention; empty: there is none
   * @param {number} nowMs of a monotonic clock
   * @param {Date} at the same moment, for people
   */
  add(verdict, text, nowMs, at = new Date()) {
    if (!text) return;
    const { code, side = null, sensor = null, allowed } = verdict;
    const key = `${code} ${sensor} ${side}`;
    const [last] = this.#list;
    const goesOn = last?.key === key && nowMs - this.#seenMs < LINGERS_MS;
    const limit = Math.min(goesOn ? last.limit : Infinity, speedOf(allowed));
    const reason = { key, text, limit, at: goesOn ? last.at : at };
    this.#list = [reason, ...(goesOn ? this.#list.slice(1) : this.#list)].slice(0, KEPT);
    this.#seenMs = nowMs;
  }

  /** The reason why the gate slowed the robot in the last seconds; empty: there was none. */
  recent(nowMs) {
    return nowMs - this.#seenMs < LINGERS_MS ? this.#list[0].text : "";
  }

  /** The last five, newest first: text, time, and the lowest speed that was allowed, m/s. */
  get list() {
    return this.#list;
  }
}

function speedOf([vx, vy]) {
  return Math.hypot(vx, vy);
}
