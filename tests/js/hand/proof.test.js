import { describe, expect, it } from "vitest";
import { PATIENCE_MS, Proof } from "../../../static/js/hand/proof.js";

/** Return a proof of a key that repeats every `gapMs` until `endMs`. */
function repeating(gapMs, endMs) {
  const proof = new Proof(0);
  for (let ms = gapMs; ms <= endMs; ms += gapMs) proof.repeat(ms);
  return proof;
}

describe("the proof of a grip", () => {
  it("lasts four seconds after an event, and asks for a sign before", () => {
    const proof = new Proof(0);
    proof.renew(1_000);
    expect([proof.failure(4_900), proof.failure(5_000)]).toEqual([null, "silent"]);
    expect([proof.isSoonOver(3_400), proof.isSoonOver(3_600)]).toEqual([false, true]);
  });

  it("ends soon after a key's repeat, slow or fast", () => {
    const fast = repeating(40, 2_000);
    expect([fast.failure(2_900), fast.failure(3_000)]).toEqual([null, "repeat-ended"]);
    const slow = repeating(500, 5_000);
    expect([slow.failure(6_900), slow.failure(7_000)]).toEqual([null, "repeat-ended"]);
    const slowest = repeating(1_800, 9_000);
    expect([slowest.failure(12_900), slowest.failure(13_000)]).toEqual([null, "silent"]);
  });

  it("expects no repeat of a key that has not repeated yet, or after another key", () => {
    const pressed = new Proof(0);
    pressed.repeat(660);
    expect(pressed.failure(PATIENCE_MS)).toBeNull();
    const both = repeating(40, 2_000);
    both.expectNoRepeat(); // a second key
    expect([both.failure(5_900), both.failure(6_000)]).toEqual([null, "silent"]);
  });

  it("ends a key that only repeats for 30 s, as a jammed key does, and asks for a sign before", () => {
    const jammed = repeating(50, 29_950);
    expect([jammed.failure(29_950), jammed.failure(30_000)]).toEqual([null, "only-repeats"]);
    expect([jammed.isSoonOver(28_400), jammed.isSoonOver(28_500)]).toEqual([false, true]);
    jammed.renew(29_950); // another key that steers
    expect(jammed.failure(30_000)).toBeNull();
  });

  it("may have another patience, or none to lose", () => {
    expect(new Proof(0, 30_000).failure(29_999)).toBeNull();
    const patient = new Proof(0, Number.POSITIVE_INFINITY);
    expect([patient.failure(1e9), patient.isSoonOver(1e9)]).toEqual([null, false]);
  });
});
