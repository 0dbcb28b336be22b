/** The moment that a replay shows. It plays on through the parts that the person sees. No page; times: s since the begin. */

/** @typedef {[number, number]} Part begin and end */

/** Return the moment of a part that is nearest to `atS`; between two parts, the begin of the next one. Pure. */
export function nearest(parts, atS) {
  const part = parts.find(([, end]) => atS <= end);
  if (!part) return parts.at(-1)?.[1] ?? 0;
  return Math.max(atS, part[0]);
}

/** Events: "moment" (the moment changed), "playing" (it plays, or it does not any more). */
export class Player extends EventTarget {
  #parts;
  #atS;
  #playing = false;
  speed = 1;

  /** @param {Part[]} parts in order, at least one */
  constructor(parts, atS = 0) {
    super();
    this.#parts = parts;
    this.#atS = nearest(parts, atS);
  }

  get atS() {
    return this.#atS;
  }

  set atS(atS) {
    const found = nearest(this.#parts, atS);
    if (found === this.#atS) return;
    this.#atS = found;
    this.dispatchEvent(new Event("moment"));
  }

  get playing() {
    return this.#playing;
  }

  /** To play from the end begins again. */
  set playing(playing) {
    if (playing && this.#atS >= this.endS) this.atS = this.#parts[0][0];
    if (playing === this.#playing) return;
    this.#playing = playing;
    this.dispatchEvent(new Event("playing"));
  }

  get endS() {
    return this.#parts.at(-1)[1];
  }

  /** Return the part of the present moment. */
  get part() {
    return this.#parts.find(([, end]) => this.#atS <= end) ?? this.#parts.at(-1);
  }

  /** Go on by the time that passed, at its speed; it ends at the end. @param {number} seconds */
  pass(seconds) {
    if (!this.#playing) return;
    this.atS = this.#atS + seconds * this.speed;
    if (this.#atS >= this.endS) this.playing = false;
  }
}
