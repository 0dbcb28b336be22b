import { describe, expect, it } from "vitest";
import { clockText, isLastCall, remaining } from "../../../static/js/control/lease.js";

describe("a term of control", () => {
  it("runs down by this page's clock from its arrival", () => {
    expect(remaining(60, 1000, 11_000)).toBe(50);
  });

  it("does not go below zero", () => {
    expect(remaining(5, 0, 9000)).toBe(0);
  });

  it("may have no end", () => {
    expect(remaining(null, 0, 9000)).toBeNull();
    expect(isLastCall(null)).toBe(false);
  });

  it("can be renewed near its end", () => {
    expect(isLastCall(31)).toBe(false);
    expect(isLastCall(29)).toBe(true);
  });

  it("reads like a clock", () => {
    expect(clockText(245)).toBe("4:05");
    expect(clockText(8.2)).toBe("0:09");
    expect(clockText(3720)).toBe("1 h 02 min");
  });
});
