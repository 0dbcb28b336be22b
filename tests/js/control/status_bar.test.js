import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Face } from "../../../static/js/control/status_bar.js";

const STOP = { state: "clear", by: null, reason: "", standstill_ms: null };
const STATE = {
  phase: "online",
  text: "",
  stop: STOP,
  verdict: { code: "idle", text: "", limits: [] },
  battery_percent: null,
  latency_s: 0.1,
  latency_measured: true,
  watchers: [],
  watchers_more: 0,
  sensors: [],
  foreign: [],
  refused: {},
  clock_skew_s: null,
};
const LIVE = { connected: true, gone: null, state: STATE, sinceViewMs: 0, cut: false };
const LOST = { ...LIVE, connected: false, cut: true };
const STOPPED = { ...STATE, stop: { ...STOP, state: "stopped", standstill_ms: 300 } };

describe("the face of the control page", () => {
  const named = {};
  const parts = new Proxy(named, {
    get(_parts, name) {
      named[name] ??= document.createElement("p");
      return named[name];
    },
  });
  let face;

  beforeEach(() => {
    vi.useFakeTimers();
    face = new Face(document.createElement("main"), parts);
  });
  afterEach(() => {
    face.close();
    vi.useRealTimers();
  });

  it("announces a lost connection each time", () => {
    for (let time = 0; time < 2; time += 1) {
      parts.live.textContent = "";
      face.show(LOST);
      face.show(LOST);
      expect(parts.live.textContent).toContain("No connection");
      face.show(LIVE);
      vi.advanceTimersByTime(5000);
    }
  });

  it("leaves the word to the robot once it reports the stop", () => {
    face.show(LIVE);
    face.stopSays("Stop sent");
    face.show(LIVE);
    expect(parts["stop-state"].textContent).toBe("Stop sent");
    face.show({ ...LIVE, state: STOPPED });
    expect(parts["stop-state"].textContent).toBe("Standstill after 300\u00a0ms");
    face.show(LIVE);
    expect(parts["stop-state"].textContent).toBe("");
  });

  it("tells what becomes of a stop while the last that was heard of the robot is old", () => {
    const old = { ...LOST, state: STOPPED };
    face.show(old);
    face.stopSays("Sending the stop");
    vi.advanceTimersByTime(4000);
    face.show(old);
    expect(parts["stop-state"].textContent).toBe("Sending the stop");
    vi.advanceTimersByTime(4000);
    face.show(old);
    expect(parts["stop-state"].textContent).toBe(""); // that of before would seem to be the answer
  });

  it("tells no limit of a robot that it does not hear", () => {
    const text = "held to 0.3 m/s: the camera's picture is 1.2 s old";
    const limits = [{ code: "depth_stale", text, mps: 0.3 }];
    const state = { ...STATE, verdict: { ...STATE.verdict, limits } };
    face.show({ ...LIVE, state });
    expect(parts.limits.textContent).toBe(text);
    face.show({ ...LOST, state });
    expect(parts.limits.textContent).toBe("");
  });

  it("calls a connection by what came of it: one that is open and silent is none", () => {
    const told = (now) => {
      face.show({ ...LIVE, ...now });
      return [parts.connection.textContent, parts.connection.dataset.level];
    };
    expect(told({})).toEqual(["Connected", "ok"]);
    expect(told({ state: null })).toEqual(["Connecting", "warn"]);
    expect(told({ sinceViewMs: 1500, cut: true })).toEqual(["No news", "fail"]);
    expect(told({ gone: { text: "away" } })).toEqual(["No link", "fail"]);
    expect(told({ connected: false })).toEqual(["Offline", "fail"]);
  });
});
