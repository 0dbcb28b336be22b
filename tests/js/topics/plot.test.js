import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Trace } from "../../../static/js/topics/plot.js";
import { Repeater } from "../../../static/js/topics/repeater.js";

describe("the trace of numbers", () => {
  it("keeps the last half minute, and a gap where a line has no number", () => {
    const trace = new Trace();
    trace.names = ["/a x"];
    for (let second = 0; second <= 40; second += 1) trace.add(second, new Map([["/a x", second]]));
    trace.add(41, new Map([["/b y", 1]]));
    expect(trace.columns[0][0]).toBe(11);
    expect(trace.columns[1].at(-1)).toBe(null);
  });

  it("keeps a line's past when another comes or goes", () => {
    const trace = new Trace();
    trace.names = ["/a x"];
    trace.add(0, new Map([["/a x", 5]]));
    trace.names = ["/b y", "/a x"];
    expect(trace.columns).toEqual([[0], [null], [5]]);
    trace.names = ["/a x"];
    expect(trace.columns).toEqual([[0], [5]]);
  });
});

describe("velocities that the page repeats", () => {
  beforeEach(() => vi.useFakeTimers());
  afterEach(() => vi.useRealTimers());

  it("are sent at their rate, never slower than the base's patience, until they end", () => {
    const send = vi.fn();
    const repeater = new Repeater(send);
    repeater.begin({ topic: "/key_vel", type: "geometry_msgs/Twist" }, 1);
    expect(repeater.running).toEqual([
      { topic: "/key_vel", type: "geometry_msgs/Twist", rate_hz: 5 },
    ]);
    vi.advanceTimersByTime(1000);
    expect(send).toHaveBeenCalledTimes(6);
    expect(repeater.end("/other")).toBe(false);
    expect(repeater.end("/key_vel")).toBe(true);
    vi.advanceTimersByTime(1000);
    expect(send).toHaveBeenCalledTimes(6);
  });
});
