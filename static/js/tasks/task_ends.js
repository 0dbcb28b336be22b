/** Reports the ends of tasks: to this page's person alone, or to everybody who watches. */

/** Return the notice level for the end of a motion or a speech. */
export function levelOf(outcome) {
  if (["succeeded", "done", "sent", "cancelled"].includes(outcome)) return "success";
  return ["rejected", "failed"].includes(outcome) ? "error" : "warning";
}

/** Reports an end to the person who began or cancelled the task; others only see it end. */
export class Endings {
  #reportsNext = false; // this page began or cancels the task: its end is reported here
  #cancels = false; // this page cancels the task: the report does not name the person
  #name = ""; // of the task that runs, or ran
  #notify;
  #last; // number of the end that is known already
  #runs = false;
  #wasSilent = false; // the robot was silent for a while: the task may have ended with its bridge

  /** @param {(ended: object, name: string) => void} notify */
  constructor(notify) {
    this.#notify = notify;
  }

  /**
   * Report the next end on this page: the page begins or cancels a task.
   * @param {string} [name] of the task that the page begins
   * @param {boolean} [cancels] whether the page cancels the running task
   * @returns {() => void} undoes this call: for a request that is refused
   */
  begin(name = this.#name, cancels = false) {
    const before = [this.#reportsNext, this.#name, this.#cancels];
    [this.#reportsNext, this.#name, this.#cancels] = [true, name, cancels];
    return () => {
      [this.#reportsNext, this.#name, this.#cancels] = before;
    };
  }

  /** The robot is out of reach. */
  lost() {
    this.#wasSilent = true;
  }

  /**
   * @param {?string} name of the running task @param {?object} ended the last end, with its number
   * @returns {boolean} whether a task has ended since the last call
   */
  follow(name, ended) {
    if (name !== null) this.#name = name;
    const isNew = this.#last !== undefined && ended !== null && ended.number !== this.#last;
    const isGone = this.#wasSilent && this.#runs && name === null && !isNew;
    this.#last = ended?.number ?? 0;
    this.#runs = name !== null;
    this.#wasSilent = false;
    if (!isNew && !isGone) return false;
    const how = isNew ? ended : { outcome: "unheard", text: "" };
    const known = this.#cancels && how.outcome === "cancelled";
    if (this.#reportsNext) this.#notify(known ? { ...how, text: "" } : how, how.name ?? this.#name);
    this.#reportsNext = this.#cancels = false;
    return true;
  }
}

/** Reports each end once, to everybody who watches. */
export class NewEnds {
  #notify;
  #known; // the last ends, by name; undefined until the first state

  /** @param {(ended: object, name: string) => void} notify */
  constructor(notify) {
    this.#notify = notify;
  }

  /** @param {Object<string, ?object>} ends the last end by name; those in the first state are old news */
  follow(ends) {
    const before = this.#known;
    this.#known = {};
    for (const [name, ended] of Object.entries(ends)) {
      const { number, fence, seq = number } = ended ?? {}; // the record's number may come later
      this.#known[name] = `${fence} ${seq}`;
      if (before && ended && before[name] !== this.#known[name]) this.#notify(ended, name);
    }
  }
}
