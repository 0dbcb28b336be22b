/** When and why the gate held the robot back: shown for some seconds after the stick is released; a list has five. */

const LINGERS_MS = 5000;
const KEPT = 5;

/** Collects the gate's interventions. Pure: the time comes from outside. */
export class Interventions {
  #list = [];
  #seenMs = -Infinity;
  #wayOut = { reason: null, seenMs: -Infinity }; // the last reason that has a button

  /**
   * @param {{code: string, side?: ?string, sensor?: ?string, allowed: number[]}} verdict the newest
   * @param {?import("./faults.js").Reason} reason its words; null: the gate holds nothing back
   * @param {number} nowMs of a monotonic clock
   * @param {Date} at the same moment, for people
   */
  add(verdict, reason, nowMs, at = new Date()) {
    if (!reason) return;
    const { code, side = null, sensor = null, allowed } = verdict;
    const key = `${code} ${sensor} ${side}`;
    const [last] = this.#list;
    const goesOn = last?.key === key && nowMs - this.#seenMs < LINGERS_MS;
    const limit = Math.min(goesOn ? last.limit : Infinity, speedOf(allowed));
    const newest = { key, reason, limit, at: goesOn ? last.at : at };
    this.#list = [newest, ...(goesOn ? this.#list.slice(1) : this.#list)].slice(0, KEPT);
    this.#seenMs = nowMs;
    if (reason.act) this.#wayOut = { reason, seenMs: nowMs };
    else if (speedOf(allowed) === 0) this.#wayOut.seenMs = -Infinity;
  }

  /**
   * The reason why the gate held the robot back in the last seconds; null: there was none. One with a button
   * comes before newer ones at which the robot is only slowed: a stick that returns asks for less and less.
   */
  recent(nowMs) {
    if (nowMs - this.#wayOut.seenMs < LINGERS_MS) return this.#wayOut.reason;
    return nowMs - this.#seenMs < LINGERS_MS ? this.#list[0].reason : null;
  }

  /** The last five, newest first: reason, time, and the lowest speed that was allowed, m/s. */
  get list() {
    return this.#list;
  }
}

function speedOf([vx, vy]) {
  return Math.hypot(vx, vy);
}
