import { describe, expect, it } from "vitest";
import { SpeedTrace } from "../../static/js/chart.js";

describe("the trace of speeds", () => {
  it("keeps the last twenty seconds", () => {
    const trace = new SpeedTrace();
    const state = { verdict: { asked: [0.4, 0, 0], allowed: [0.3, 0, 0] }, odometry: null };
    for (let second = 0; second <= 30; second += 1) trace.add(second, state);
    expect(trace.columns[0][0]).toBe(10);
    expect(trace.columns.map((column) => column.at(-1))).toEqual([30, 0.4, 0.3, null]);
  });
});
