/** Ends of motions and speech: for the person of this page, and for everybody. */

/** Importance of a motion's or a speech's end. */
export function levelOf(outcome) {
  if (["succeeded", "done", "sent", "cancelled"].includes(outcome)) return "success";
  return ["rejected", "failed"].includes(outcome) ? "error" : "warning";
}

/** Reports an end to the person who began or cancelled the task; others only see it end. */
export class Endings {
  #mine = false; // the next ending answers to this page
  #cancels = false; // this page cancels the task: its report need not name who did
  #name = ""; // of what runs, or ran
  #tell;
  #last; // number of the ending that is known already
  #runs = false;
  #blind = false; // the robot was silent for a while: the task may have ended with its bridge

  /** @param {(ended: object, name: string) => void} tell */
  constructor(tell) {
    this.#tell = tell;
  }

  /**
   * The next ending answers to this page, which begins or cancels something.
   * @param {string} [name] of what it begins
   * @param {boolean} [cancels] whether it cancels the running task
   * @returns {() => void} call it if that was refused: then nothing changed
   */
  begin(name = this.#name, cancels = false) {
    const before = [this.#mine, this.#name, this.#cancels];
    [this.#mine, this.#name, this.#cancels] = [true, name, cancels];
    return () => {
      [this.#mine, this.#name, this.#cancels] = before;
    };
  }

  /** The robot is out of reach. */
  lost() {
    this.#blind = true;
  }

  /**
   * @param {?string} name of what runs @param {?object} ended the last that ended, with its number
   * @returns {boolean} whether something ended since
   */
  follow(name, ended) {
    if (name !== null) this.#name = name;
    const isNew = this.#last !== undefined && ended !== null && ended.number !== this.#last;
    const isGone = this.#blind && this.#runs && name === null && !isNew;
    this.#last = ended?.number ?? 0;
    this.#runs = name !== null;
    this.#blind = false;
    if (!isNew && !isGone) return false;
    const how = isNew ? ended : { outcome: "unheard", text: "" };
    const known = this.#cancels && how.outcome === "cancelled";
    if (this.#mine) this.#tell(known ? { ...how, text: "" } : how, how.name ?? this.#name);
    this.#mine = this.#cancels = false;
    return true;
  }
}

/** Reports to all viewers that a chosen topic vanished and input goes to another one. */
export class ChoiceEnds {
  #tell;
  #known; // number of the last end by use; unknown until the first state

  /** @param {(text: string) => void} tell */
  constructor(tell) {
    this.#tell = tell;
  }

  /** @param {Object<string, {number: number, text: string}>} ended by use. The first state is old news. */
  follow(ended) {
    const before = this.#known;
    this.#known = Object.fromEntries(
      Object.entries(ended).map(([use, { number }]) => [use, number]),
    );
    if (before === undefined) return;
    for (const [use, { number, text }] of Object.entries(ended))
      if (before[use] !== number) this.#tell(text);
  }
}
