import { describe, expect, it } from "vitest";
import { waitBefore } from "../../../static/js/connection/backoff.js";

const unlucky = () => 0;
const lucky = () => 1;

describe("the wait before connecting again", () => {
  it("doubles from a quarter of a second", () => {
    expect([0, 1, 2].map((n) => waitBefore(n, unlucky))).toEqual([250, 500, 1000]);
  });

  it("is never longer than two seconds, however often it failed", () => {
    expect(waitBefore(3, unlucky)).toBe(2000);
    expect(waitBefore(10_000, unlucky)).toBe(2000);
  });

  it("differs between pages by up to a fifth", () => {
    expect(waitBefore(3, lucky)).toBe(1600);
  });
});
