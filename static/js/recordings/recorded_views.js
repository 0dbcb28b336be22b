/** What pages showed: the recorded views around the moment, read in pieces before they are needed. */

const PIECE_S = 5; // of one request, if its views are small
const AHEAD_S = 5;
const PIECES_AT_MOST = 24; // that are kept

/** A view with its time and the stick position of that time. @typedef {[number, object, ?object]} Recorded */

/** Return the last of these entries that is not later than `atS`; undefined: there is none. Pure. */
export function lastUntil(entries, atS) {
  return entries.findLast(([time]) => time <= atS);
}

/** Events: "read" (a piece came), "problem" (detail: a sentence). */
export class RecordedViews extends EventTarget {
  #read;
  #pieces = new Map(); // by the number of the piece: its entries
  #reading = new Set();

  /** @param {(fromS: number, untilS: number) => Promise<{views: Recorded[], until_s: number}>} read */
  constructor(read) {
    super();
    this.#read = read;
  }

  /**
   * Return the view of a moment, if it was read; it is read if not, and so is what follows.
   * @param {number} atS @param {[number, number]} part outside of which nothing is read
   * @returns {?Recorded} null: not read yet, or there was none
   */
  at(atS, part) {
    const number = Math.floor(atS / PIECE_S);
    this.#want(number, part);
    if (atS + AHEAD_S < part[1]) this.#want(Math.floor((atS + AHEAD_S) / PIECE_S), part);
    return (
      lastUntil(this.#pieces.get(number) ?? [], atS) ??
      lastUntil(this.#pieces.get(number - 1) ?? [], atS) ??
      null
    );
  }

  /** Whether the piece of a moment was read. */
  has(atS) {
    return this.#pieces.has(Math.floor(atS / PIECE_S));
  }

  async #want(number, part) {
    if (this.#pieces.has(number) || this.#reading.has(number)) return;
    this.#reading.add(number);
    const entries = [];
    try {
      const endS = Math.min((number + 1) * PIECE_S, part[1]);
      for (let fromS = Math.max(number * PIECE_S, part[0]); fromS < endS; ) {
        const { views, until_s: untilS } = await this.#read(fromS, endS);
        for (const entry of views) if (entry[0] > (entries.at(-1)?.[0] ?? -1)) entries.push(entry);
        if (untilS <= fromS) break;
        fromS = untilS;
      }
      this.#keep(number, entries);
      this.dispatchEvent(new Event("read"));
    } catch (error) {
      this.dispatchEvent(new CustomEvent("problem", { detail: error.message }));
    } finally {
      this.#reading.delete(number);
    }
  }

  #keep(number, entries) {
    this.#pieces.set(number, entries);
    const [oldest] = this.#pieces.keys();
    if (this.#pieces.size > PIECES_AT_MOST) this.#pieces.delete(oldest);
  }
}
