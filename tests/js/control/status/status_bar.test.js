import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { StatusBar } from "../../../../static/js/control/status/status_bar.js";
import { STATE as COMMON } from "./state.js";

const STOP = { state: "clear", by: null, reason: "", standstill_ms: null };
const STATE = {
  ...COMMON,
  phase: "online",
  text: "",
  stop: STOP,
  verdict: { code: "idle", text: "", limits: [] },
  battery_percent: null,
};
const LIVE = { connected: true, gone: null, state: STATE, sinceViewMs: 0, cut: false };
const LOST = { ...LIVE, connected: false, cut: true };
const STOPPED = { ...STATE, stop: { ...STOP, state: "stopped", standstill_ms: 300 } };

describe("the status bar of the control page", () => {
  const named = {};
  const parts = new Proxy(named, {
    get(_parts, name) {
      named[name] ??= document.createElement("p");
      return named[name];
    },
  });
  let statusBar;
  let notify;

  beforeEach(() => {
    vi.useFakeTimers();
    notify = vi.fn();
    statusBar = new StatusBar(document.createElement("main"), parts, notify);
  });
  afterEach(() => {
    statusBar.close();
    vi.useRealTimers();
  });

  it("has an alarm read at once, and once", () => {
    const moves = { parts: ["base"], speed_mps: 0.3, text: "It drives at 0.3 m/s." };
    const state = { ...STOPPED, stands: false, moves_although_stopped: moves };
    statusBar.show({ ...LIVE, state });
    statusBar.show({
      ...LIVE,
      state: { ...state, moves_although_stopped: { ...moves, text: "…" } },
    });
    expect(parts.banner.dataset.level).toBe("alarm");
    expect(notify.mock.calls).toEqual([
      [expect.objectContaining({ level: "error", code: "moves_although_stopped", quiet: true })],
    ]);
    expect(notify.mock.calls[0][0].text).toContain("It drives at 0.3 m/s.");
    statusBar.show({ ...LIVE, state: STOPPED });
    statusBar.show({ ...LIVE, state });
    expect(notify).toHaveBeenCalledTimes(2);
  });

  it("announces a lost connection each time", () => {
    for (let time = 0; time < 2; time += 1) {
      parts.live.textContent = "";
      statusBar.show(LOST);
      statusBar.show(LOST);
      expect(parts.live.textContent).toContain("No connection");
      statusBar.show(LIVE);
      vi.advanceTimersByTime(5000);
    }
  });

  it("shows the robot's own report once it reports the stop", () => {
    statusBar.show(LIVE);
    statusBar.stopSays("Stop sent");
    statusBar.show(LIVE);
    expect(parts["stop-state"].textContent).toBe("Stop sent");
    statusBar.show({ ...LIVE, state: STOPPED });
    expect(parts["stop-state"].textContent).toBe("Standstill after 300\u00a0ms");
    statusBar.show(LIVE);
    expect(parts["stop-state"].textContent).toBe("");
  });

  it("shows the stop's progress while the robot's state is old", () => {
    const old = { ...LOST, state: STOPPED };
    statusBar.show(old);
    statusBar.stopSays("Sending the stop");
    vi.advanceTimersByTime(4000);
    statusBar.show(old);
    expect(parts["stop-state"].textContent).toBe("Sending the stop");
    vi.advanceTimersByTime(4000);
    statusBar.show(old);
    expect(parts["stop-state"].textContent).toBe(""); // nothing: the old "stopped" would look like the answer
  });

  it("shows no speed limit while the robot is silent", () => {
    const text = "at most 0.3 m/s: the camera's picture is 1.2 s old";
    const limits = [{ code: "depth_stale", text, mps: 0.3 }];
    const state = { ...STATE, verdict: { ...STATE.verdict, limits } };
    statusBar.show({ ...LIVE, state });
    expect(parts.limits.textContent).toBe(text);
    statusBar.show({ ...LOST, state });
    expect(parts.limits.textContent).toBe("");
  });

  it("shows why reverse was refused, also some seconds after the stick is in the middle", () => {
    const text = "no sensor has looked behind. Look";
    const verdict = {
      ...STATE.verdict,
      code: "neutral_needed",
      text: "let go",
      allowed: [0, 0, 0],
    };
    const state = { ...STATE, verdict, neutral_needed: { code: "behind_unseen", text } };
    statusBar.show({ ...LIVE, state, asksNeutral: true });
    expect([parts.words.textContent, parts.words.dataset.past]).toEqual([text, undefined]);
    statusBar.show(LIVE);
    expect([parts.words.textContent, parts.words.dataset.past]).toEqual([text, "true"]);
    expect(parts.live.textContent).toContain("Let the stick return to the middle");
    vi.advanceTimersByTime(5000);
    statusBar.show(LIVE);
    expect(parts.words.textContent).toBe("");
  });

  it("asks loudly for a sign of the hand", () => {
    statusBar.hint("Still there?", true);
    expect(parts.hint.dataset.asks).toBeDefined();
    statusBar.hint("");
    expect(parts.hint.dataset.asks).toBeUndefined();
  });

  it("calls an open but silent connection No news", () => {
    const shown = (now) => {
      statusBar.show({ ...LIVE, ...now });
      return [parts.connection.textContent, parts.connection.dataset.level];
    };
    expect(shown({})).toEqual(["Connected", "ok"]);
    expect(shown({ state: null })).toEqual(["Connecting", "warn"]);
    expect(shown({ sinceViewMs: 1500, cut: true })).toEqual(["No news", "fail"]);
    expect(shown({ gone: { text: "away" } })).toEqual(["No link", "fail"]);
    expect(shown({ connected: false })).toEqual(["Offline", "fail"]);
  });
});
