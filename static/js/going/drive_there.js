/** Drives a short way by two requests, one after the other: a turn on the spot, then straight on. */

/** One drive at a time. Only an end that is "done" leads to the next request: every other end is the end. */
export class DriveThere {
  #request;
  #over;
  #way = null; // () => Way: from where the robot stands now; null: nothing runs
  #isAccepted = false; // the robot drives the request that was sent last
  #isStraight = false; // that request is the second
  #last; // number of the last end that is known

  /**
   * @param {(request: object) => Promise<?object>} request sends a task; returns the refusal or null
   * @param {(ended: ?object) => void} over gets the robot's last end; null: a request was refused, or the way was not
   *   free any more after the turn
   */
  constructor(request, over) {
    this.#request = request;
    this.#over = over;
  }

  get runs() {
    return this.#way !== null;
  }

  /** @param {() => import("./way.js").Way} way from where the robot stands when it is called */
  begin(way) {
    this.#way = way;
    const { turnRad } = way();
    if (turnRad) this.#ask({ angle_rad: turnRad }, false);
    else this.#goOn();
  }

  /** @param {{now: ?object, ended: ?object}} drive as the newest view of the robot tells it */
  set drive({ now, ended }) {
    const isAsked = this.#way !== null && !this.#isAccepted;
    if (now || isAsked) return; // another drive may have ended meanwhile: its end is not this one's
    const isNew = Boolean(ended) && ended.number !== this.#last;
    this.#last = ended?.number;
    if (!isNew || this.#way === null) return;
    if (ended.outcome === "done" && !this.#isStraight) this.#goOn();
    else this.#end(ended);
  }

  /** End it: nothing more is sent but the cancel of what runs. */
  cancel() {
    if (this.#way === null) return;
    this.#way = null;
    this.#request({ t: "drive_by_cancel" });
  }

  /** Forget it: the robot ends what runs by itself. */
  drop() {
    this.#way = null;
  }

  #goOn() {
    const { distanceM, problem } = this.#way();
    if (problem) this.#end(null);
    else this.#ask({ distance_m: distanceM }, true);
  }

  async #ask(request, isStraight) {
    const way = this.#way;
    this.#isAccepted = false;
    this.#isStraight = isStraight;
    const title = gettext("Drive there");
    const refusal = await this.#request({ t: "drive_by", title, ...request });
    if (this.#way !== way) return;
    if (refusal) this.#end(null);
    else this.#isAccepted = true;
  }

  #end(ended) {
    this.#way = null;
    this.#over(ended);
  }
}
