import { describe, expect, it } from "vitest";
import { Trace } from "../../../static/js/plots/rolling_plot.js";

describe("the trace of numbers", () => {
  it("keeps the last 30 s, with gaps for missing numbers", () => {
    const trace = new Trace(30);
    trace.names = ["/a x"];
    for (let second = 0; second <= 40; second += 1) trace.add(second, new Map([["/a x", second]]));
    trace.add(41, new Map([["/b y", 1]]));
    expect(trace.columns[0][0]).toBe(11);
    expect(trace.columns[1].at(-1)).toBe(null);
  });

  it("keeps a line's past when another is added or removed", () => {
    const trace = new Trace(30);
    trace.names = ["/a x"];
    trace.add(0, new Map([["/a x", 5]]));
    trace.names = ["/b y", "/a x"];
    expect(trace.columns).toEqual([[0], [null], [5]]);
    trace.names = ["/a x"];
    expect(trace.columns).toEqual([[0], [5]]);
  });
});
