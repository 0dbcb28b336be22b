import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { StatusBar } from "../../../../static/js/control/status/status_bar.js";
import { STATE as COMMON } from "./state.js";

const STOP = { state: "clear", by: null, reason: "", standstill_ms: null };
const STATE = {
  ...COMMON,
  phase: "online",
  text: "",
  stop: STOP,
  verdict: { code: "idle", text: "", asked: [0, 0, 0], allowed: [0, 0, 0], limits: [] },
  battery_percent: null,
};
const LIVE = { connected: true, gone: null, state: STATE, sinceViewMs: 0, silence: null };
const LOST = { ...LIVE, connected: false, silence: { who: "page", forMs: 100 } };
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
  const take = vi.fn();
  const backOff = vi.fn();

  beforeEach(() => {
    vi.useFakeTimers();
    notify = vi.fn();
    statusBar = new StatusBar(
      document.createElement("main"),
      parts,
      { take, back_off: backOff },
      notify,
    );
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
    expect(parts.reason.dataset.level).toBe("alarm");
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
    expect(parts["stop-state"].textContent).toBe("May not arrive"); // the old "stopped" would look like the answer
  });

  it("is loud about a stop that nobody confirmed, until somebody does", () => {
    const fails = () => {
      statusBar.stopFailed("No answer to the stop.");
      statusBar.show(LIVE);
      expect(parts.reason.dataset.level).toBe("alarm");
    };
    fails();
    expect(parts["stop-state"].textContent).toBe("Not confirmed");
    expect(notify.mock.lastCall[0]).toMatchObject({ code: "stop", quiet: true });
    statusBar.show({ ...LIVE, state: STOPPED });
    statusBar.show(LIVE);
    expect(parts.reason.hidden).toBe(true);
    fails();
    statusBar.stopSays("Stop sent");
    statusBar.show(LIVE);
    expect(parts.reason.hidden).toBe(true);
    fails();
    parts["reason-act"].click();
    statusBar.show(LIVE);
    expect(parts.reason.hidden).toBe(true);
  });

  it("offers control to a person who tries to drive without it, for a moment", () => {
    statusBar.wished({ level: "warning", title: "You cannot drive yet", act: "take" });
    statusBar.show(LIVE);
    expect(parts["reason-act"].textContent).toBe("Take control");
    parts["reason-act"].click();
    expect(take).toHaveBeenCalledOnce();
    statusBar.granted();
    statusBar.show(LIVE);
    expect(parts.reason.hidden).toBe(true);
  });

  it("keeps the end of a failed task until it is read", () => {
    statusBar.ended({ text: "The robot stopped on its way", detail: "held back" });
    vi.advanceTimersByTime(30_000);
    statusBar.show(LIVE);
    expect(parts["reason-title"].textContent).toBe("The robot stopped on its way");
    expect(parts["reasons-now"].textContent).toContain("held back");
    parts["reason-act"].click();
    statusBar.show(LIVE);
    expect(parts.reason.hidden).toBe(true);
  });

  it("forgets the end of a failed task when the robot tries again", () => {
    statusBar.ended({ text: "The robot stopped on its way", detail: "held back" });
    statusBar.show({ ...LIVE, state: { ...STATE, going: { number: 2 } } });
    expect(parts.reason.hidden).toBe(true);
    statusBar.show(LIVE);
    expect(parts.reason.hidden).toBe(true);
  });

  it("moves no robot by a press that was meant for the button's last words", () => {
    const verdict = {
      code: "obstacle",
      text: "",
      asked: [0.4, 0, 0],
      allowed: [0, 0, 0],
      side: "ahead",
    };
    const held = { ...LIVE, state: { ...STATE, verdict }, mayAct: true };
    statusBar.wished({ level: "warning", title: "Take control first", act: "take" });
    statusBar.show(held);
    statusBar.granted();
    statusBar.show(held);
    expect(parts["reason-act"].textContent).toBe("Back off");
    vi.advanceTimersByTime(400);
    parts["reason-act"].click(); // the second press of a double click
    expect(backOff).not.toHaveBeenCalled();
    vi.advanceTimersByTime(200);
    parts["reason-act"].click();
    expect(backOff).toHaveBeenCalledOnce();
  });

  it("counts the reasons that it does not show", () => {
    statusBar.show({ ...LIVE, state: { ...STATE, watchdog_missing: true }, hint: "Reversing" });
    expect(parts["reason-title"].textContent).toBe("Reversing");
    expect([parts["reason-more"].hidden, parts["reason-more"].textContent]).toEqual([
      false,
      "See all 2",
    ]);
    statusBar.show(LOST);
    expect([parts["reason-more"].hidden, parts["reason-more"].textContent]).toEqual([false, "…"]);
  });

  it("says in the header who is silent, and for how long", () => {
    const shown = (now) => {
      statusBar.show({ ...LIVE, ...now });
      return [parts.connection.textContent, parts.connection.dataset.level];
    };
    expect(shown({})).toEqual(["Connected", "ok"]);
    expect(shown({ state: null })).toEqual(["Connecting", "warn"]);
    expect(shown({ silence: { who: "robot", forMs: 4200 } })).toEqual([
      "Robot: no answer, 4 s",
      "fail",
    ]);
    expect(shown({ connected: false, silence: { who: "page", forMs: null } })).toEqual([
      "Offline",
      "fail",
    ]);
  });
});
