import { describe, expect, it } from "vitest";
import { firstShare, paceText, sharesUpTo } from "../../../static/js/drive/driving_options.js";

describe("the speeds offered", () => {
  it("go in fifths up to the robot's own limit", () => {
    expect(sharesUpTo(1)).toEqual([0.2, 0.4, 0.6, 0.8, 1]);
    expect(sharesUpTo(0.5)).toEqual([0.2, 0.4, 0.5]);
    expect(sharesUpTo(0.1)).toEqual([0.1]);
  });

  it("begin with the largest that is not above the robot's default", () => {
    expect(firstShare([0.2, 0.4, 0.6], 0.5)).toBe(0.4);
    expect(firstShare([0.2, 0.4, 0.6], 0.4)).toBe(0.4);
    expect(firstShare([0.2, 0.4], 0.1)).toBe(0.2);
  });

  it("are named by walking speeds", () => {
    expect([0.2, 0.4, 0.8, 1, 3].map(paceText)).toEqual([
      "very slow",
      "slow",
      "a stroll",
      "walking pace",
      "faster than walking",
    ]);
  });
});
