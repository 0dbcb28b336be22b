/** Views that pages showed: the recorded ones around the moment, read in pieces before they are needed. */

const PIECE_S = 5; // of one request, if its views are small
const AHEAD_S = 5;
const PIECES_AT_MOST = 24; // that are kept
const AGAIN_MS = 2000; // until a piece that could not be read is asked again; twice as long after each failure
const AGAIN_AT_MOST_MS = 60_000;

/** A view with its time and the stick position of that time. @typedef {[number, object, ?object]} Recorded */

/** Return the last of these entries that is not later than `atS`; undefined: there is none. Pure. */
export function lastUntil(entries, atS) {
  return entries.findLast(([time]) => time <= atS);
}

/** Return the name of the piece of a moment. Two parts may share its time, and each has its own. Pure. */
function pieceOf(atS, [begin], earlier = 0) {
  return `${begin} ${Math.floor(atS / PIECE_S) - earlier}`;
}

/** Events: "read" (a piece came, or may be asked again), "problem" (detail: a sentence; empty: it is over). */
export class RecordedViews extends EventTarget {
  #read;
  #pieces = new Map(); // by the name of the piece: its entries
  #reading = new Set(); // that are read, or could not be read a moment ago
  #againMs = AGAIN_MS;

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
    this.#want(atS, part);
    if (atS + AHEAD_S < part[1]) this.#want(atS + AHEAD_S, part);
    return (
      lastUntil(this.#pieces.get(pieceOf(atS, part)) ?? [], atS) ??
      lastUntil(this.#pieces.get(pieceOf(atS, part, 1)) ?? [], atS) ??
      null
    );
  }

  /** Whether the piece of a moment was read. */
  has(atS, part) {
    return this.#pieces.has(pieceOf(atS, part));
  }

  async #want(atS, part) {
    const name = pieceOf(atS, part);
    if (this.#pieces.has(name) || this.#reading.has(name)) return;
    this.#reading.add(name);
    try {
      this.#keep(name, await this.#entries(Math.floor(atS / PIECE_S) * PIECE_S, part));
    } catch (error) {
      setTimeout(() => this.#done(name), this.#againMs);
      this.#againMs = Math.min(2 * this.#againMs, AGAIN_AT_MOST_MS);
      this.dispatchEvent(new CustomEvent("problem", { detail: error.message }));
      return;
    }
    if (this.#againMs > AGAIN_MS) this.dispatchEvent(new CustomEvent("problem", { detail: "" }));
    this.#againMs = AGAIN_MS;
    this.#done(name);
  }

  async #entries(beginS, part) {
    const entries = [];
    const endS = Math.min(beginS + PIECE_S, part[1]);
    for (let fromS = Math.max(beginS, part[0]); fromS < endS; ) {
      const { views, until_s: untilS } = await this.#read(fromS, endS);
      for (const entry of views) if (entry[0] > (entries.at(-1)?.[0] ?? -1)) entries.push(entry);
      if (untilS <= fromS) break;
      fromS = untilS;
    }
    return entries;
  }

  #done(name) {
    this.#reading.delete(name);
    this.dispatchEvent(new Event("read"));
  }

  #keep(name, entries) {
    this.#pieces.set(name, entries);
    const [oldest] = this.#pieces.keys();
    if (this.#pieces.size > PIECES_AT_MOST) this.#pieces.delete(oldest);
  }
}
