/** How what was begun on this page ends. */

/** Tells the person who began or cancelled something how it ended; others only see it end. */
export class Endings {
  mine = false; // the next ending answers to this page
  name = ""; // of what runs, or ran
  #tell;
  #last; // number of the ending that is known already

  /** @param {(ended: object, name: string) => void} tell */
  constructor(tell) {
    this.#tell = tell;
  }

  /**
   * @param {?string} name of what runs @param {?object} ended the last that ended, with its number
   * @returns {boolean} whether something ended since
   */
  follow(name, ended) {
    if (name !== null) this.name = name;
    const number = ended?.number ?? 0;
    const isNew = this.#last !== undefined && number !== this.#last;
    this.#last = number;
    if (!isNew) return false;
    if (this.mine) this.#tell(ended, ended.name ?? this.name);
    this.mine = false;
    return true;
  }
}
