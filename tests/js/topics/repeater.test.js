import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Repeater } from "../../../static/js/topics/repeater.js";

const TWIST = {
  t: "publish",
  topic: "/key_vel",
  type: "geometry_msgs/Twist",
  fields: { linear: { x: 0.2 } },
};
const REST = { ...TWIST, fields: {}, quiet: true };

describe("repeated velocities", () => {
  let sent;
  let repeater;

  beforeEach(() => {
    vi.useFakeTimers();
    vi.spyOn(document, "hasFocus").mockReturnValue(true);
    sent = [];
    repeater = new Repeater((request) => sent.push(request));
  });
  afterEach(() => {
    repeater.end();
    vi.restoreAllMocks();
    vi.useRealTimers();
  });

  it("are reported once, then repeated quietly", () => {
    repeater.begin(TWIST, 10);
    vi.advanceTimersByTime(250);
    expect(sent).toEqual([REST, TWIST, { ...TWIST, quiet: true }, { ...TWIST, quiet: true }]);
  });

  it("begin from rest at each press, as a stick does", () => {
    repeater.once(TWIST);
    repeater.once(TWIST);
    expect(sent).toEqual([REST, TWIST, REST, TWIST]);
  });

  it("are sent at least as often as the base needs", () => {
    repeater.begin(TWIST, 1);
    vi.advanceTimersByTime(1000);
    expect(sent.length).toBe(7);
    expect(repeater.running).toEqual([{ topic: "/key_vel", type: TWIST.type, rate_hz: 5 }]);
  });

  it("end after 30 s without a press, as a stick that was left alone", () => {
    repeater.begin(TWIST, 5);
    vi.advanceTimersByTime(29_000);
    expect(repeater.running.length).toBe(1);
    vi.advanceTimersByTime(1_500);
    expect(repeater.running).toEqual([]);
  });

  it("end at once", () => {
    repeater.begin(TWIST, 10);
    expect(repeater.end("/other")).toBe(false);
    expect(repeater.end("/key_vel")).toBe(true);
    vi.advanceTimersByTime(1000);
    expect(sent).toEqual([REST, TWIST]);
    expect(repeater.end()).toBe(false);
  });
});
