/**
 * How long an input counts as held without an event that proves it. Pure: the caller gives times in ms.
 *
 * A page may miss the release of a button or key: a menu, a dialog, the window system or another program took it.
 * A hand that holds a mouse still sends nothing either. So each grip must be proven again before its patience ends.
 */

export const PATIENCE_MS = 4_000;
export const WITHOUT_HAND_MS = 30_000; // for motion that a person chose to leave alone: *Stick stays*, repeated velocities
export const MOST_REPEATED_MS = 30_000; // the computer repeats a key, also one that is jammed or whose release is lost
export const SOON_MS = 1_500; // before the end of the patience, the page asks for a sign

// Key repeat: its silence means that the key is up. The slowest repeat that systems offer is one in 1.8 s.
const REPEATS_MISSED = 4;
const LEAST_SILENCE_MS = 1_000; // a busy page reads keys late

export class Proof {
  patienceMs;
  #lastMs;
  #handMs; // the last event that was no repeat
  #repeats = false;
  #longestGapMs = 0; // between two repeats

  constructor(nowMs, patienceMs = PATIENCE_MS) {
    this.patienceMs = patienceMs;
    this.#lastMs = this.#handMs = nowMs;
  }

  /** An event of the hand. A key repeat begins anew after it. */
  renew(nowMs) {
    this.#lastMs = this.#handMs = nowMs;
    this.expectNoRepeat();
  }

  /** Another key may have ended the repeat of this one. That proves nothing: the patience goes on. */
  expectNoRepeat() {
    this.#repeats = false;
    this.#longestGapMs = 0;
  }

  /** A repeat of a held key. */
  repeat(nowMs) {
    if (this.#repeats) this.#longestGapMs = Math.max(this.#longestGapMs, nowMs - this.#lastMs);
    this.#repeats = true;
    this.#lastMs = nowMs;
  }

  /** Why the grip is over: "repeat-ended", "only-repeats" or "silent"; null: it is proven. */
  failure(nowMs) {
    if (nowMs >= this.#repeatedUntilMs) return "only-repeats";
    if (nowMs < this.#lastMs + this.#limitMs) return null;
    return this.#limitMs < this.patienceMs ? "repeat-ended" : "silent";
  }

  /** Return whether the hand must give a sign soon. A key that repeats no more asks for none: it ends at once. */
  isSoonOver(nowMs) {
    const silentMs = this.#limitMs < this.patienceMs ? Infinity : this.#lastMs + this.patienceMs;
    return nowMs >= Math.min(silentMs, this.#repeatedUntilMs) - SOON_MS;
  }

  get #repeatedUntilMs() {
    return this.#repeats ? this.#handMs + MOST_REPEATED_MS : Infinity;
  }

  get #limitMs() {
    if (this.#longestGapMs === 0) return this.patienceMs;
    const silenceMs = Math.max(REPEATS_MISSED * this.#longestGapMs, LEAST_SILENCE_MS);
    return Math.min(silenceMs, this.patienceMs);
  }
}
