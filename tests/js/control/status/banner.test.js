import { describe, expect, it } from "vitest";
import { banner } from "../../../../static/js/control/status/banner.js";
import { stopText } from "../../../../static/js/control/status/status_text.js";

const CLEAR = { state: "clear", by: null, reason: "", standstill_ms: null };
const ONLINE = { phase: "online", text: "", stop: CLEAR, neutral_needed: null };
const WELL = {
  connected: true,
  gone: null,
  state: ONLINE,
  sinceViewMs: 50,
  asksNeutral: false,
};

describe("the banner", () => {
  it("names an overloaded computer, with the figure", () => {
    const state = { ...ONLINE, overload: { part: "bridge", late_s: 0.25 } };
    expect(banner({ ...WELL, state })).toMatchObject({
      level: "console",
      title: "The console’s computer is overloaded",
      text: expect.stringContaining("The robot’s bridge was 0.3 s late."),
    });
  });

  it("names the person whose stop is pending", () => {
    const pending = { by: "Ann", reason: "", at: Date.now() / 1000 };
    const { title, text } = banner({ ...WELL, gone: { text: "No bridge." }, pending });
    expect(title).toBe("No link to the robot");
    expect(text).toMatch(
      /^A stop by Ann, .+, waits for the robot and is delivered when it is back\. /,
    );
    expect(banner({ ...WELL, gone: { text: "No bridge." }, pending: null }).text).not.toContain(
      "stop by",
    );
  });

  it("warns of a missing watchdog unless something is worse", () => {
    const state = { ...ONLINE, watchdog_missing: true };
    expect(banner({ ...WELL, state })).toMatchObject({
      level: "watchdog",
      title: "A safety program is missing: keep the red button in reach",
      text: expect.stringContaining("A stop depends on one program alone"),
    });
    const stop = { ...CLEAR, state: "stopped", by: "Bo" };
    expect(banner({ ...WELL, state: { ...state, stop } }).title).toBe("Stopped by Bo");
  });

  it("says loudest of all that a stopped robot moves, who may drive it, and what to press", () => {
    const moves = {
      parts: ["base"],
      speed_mps: 0.3,
      text: "It drives at 0.3 m/s. Velocities for its base come from /rogue on /cmd_vel.",
    };
    const stop = { ...CLEAR, state: "stopped", by: "Bo", standstill_ms: 400 };
    const state = { ...ONLINE, stop, stands: false, moves_although_stopped: moves };
    expect(banner({ ...WELL, state, asksNeutral: true })).toEqual({
      level: "alarm",
      title: "The robot moves although it is stopped: press its red button",
      text: `${moves.text} Stopped by Bo. The console cannot stop it.`,
      clear: true,
    });
    expect(stopText(state)).toBe("It moves: red button");
    const told = "The robot moved although it is stopped: press its red button.";
    for (const cut of [{ connected: false }, { gone: { text: "No." } }, { sinceViewMs: 2400 }])
      expect(banner({ ...WELL, ...cut, state }).text).toContain(told);
    const unknown = {
      ...state,
      stands: null,
      moves_although_stopped: { ...moves, speed_mps: null },
    };
    expect(banner({ ...WELL, state: unknown }).title).toContain("nobody knows");
    const arm = { ...moves, parts: ["arm"], speed_mps: null };
    expect(banner({ ...WELL, state: { ...state, moves_although_stopped: arm } }).title).toContain(
      "The robot moves",
    );
  });

  it("says of a stop with silent odometry that nobody knows", () => {
    const stop = { ...CLEAR, state: "stopped", by: "Bo", standstill_ms: 400 };
    const state = { ...ONLINE, stop, stands: null, unseen_s: 1.5 };
    expect(banner({ ...WELL, state }).title).toBe(
      "Stop by Bo: nobody knows whether the robot stands",
    );
    expect(banner({ ...WELL, state }).text).toContain("If it moves, press its red button.");
    expect(stopText(state)).toBe("Pressed");
    expect(banner({ ...WELL, state: { ...state, stands: true } }).title).toBe("Stopped by Bo");
  });

  it("is hidden when all is well", () => {
    expect(banner(WELL)).toBeNull();
  });

  it("gives no stopping time for a robot that was standing", () => {
    const stop = { ...CLEAR, state: "stopped", by: "Bo", was_standing: true };
    expect(banner({ ...WELL, state: { ...ONLINE, stop } }).text).toBe("The robot was standing.");
    expect(stopText({ ...ONLINE, stop })).toBe("Stopped, was standing");
  });

  it("names the worst thing only", () => {
    const stopped = {
      ...ONLINE,
      stop: { ...CLEAR, state: "stopped", by: "Bo", standstill_ms: 411.6 },
    };
    expect(banner({ ...WELL, connected: false, state: stopped }).title).toBe("No connection");
    expect(banner({ ...WELL, gone: { text: "The bridge is not running." } }).text).toContain(
      "The bridge is not running.",
    );
    expect(banner({ ...WELL, state: stopped, asksNeutral: true })).toMatchObject({
      level: "stop",
      title: "Stopped by Bo",
      text: "Standstill confirmed after 412 ms.",
    });
  });

  it("says that a picture is old after a second without news", () => {
    expect(banner({ ...WELL, sinceViewMs: 900 })).toBeNull();
    expect(banner({ ...WELL, sinceViewMs: 2400 }).title).toBe("No news for 2 s");
  });

  it("does not call a stop confirmed before the robot says so", () => {
    const stopping = { ...ONLINE, stop: { ...CLEAR, state: "stopping", by: "Bo" } };
    expect(banner({ ...WELL, state: stopping }).text).toContain("not confirmed yet");
  });

  it("shows why the robot is unreachable, and what to do", () => {
    const text = "No ROS master at http://tiago-3:11311.";
    const todo = "This page continues by itself. If this lasts, tell staff.";
    const state = { ...ONLINE, phase: "waiting", text };
    expect(banner({ ...WELL, state })).toMatchObject({
      title: "Waiting for the robot",
      text: `${text} ${todo}`,
    });
    expect(banner({ ...WELL, gone: { text } }).text).toBe(`${text} ${todo}`);
    expect(banner({ ...WELL, sinceViewMs: 2400 }).text).toContain(todo);
  });

  it("asks to reload an outdated page before all else", () => {
    const shown = banner({ ...WELL, outdated: true, connected: false });
    expect(shown).toMatchObject({ title: "This page is of another version", text: "Reload it." });
  });

  it("asks for a neutral stick, with the bridge's reason", () => {
    const state = {
      ...ONLINE,
      neutral_needed: { code: "stop_cleared", text: "the stop was cleared" },
    };
    expect(banner({ ...WELL, state, asksNeutral: true })).toMatchObject({
      title: "Let the stick return to the middle",
      text: "The stop was cleared.",
    });
    expect(banner({ ...WELL, asksNeutral: true }).text).toBe("");
    expect(banner({ ...WELL, state })).toBeNull();
  });

  it("does not ask for a neutral stick while a motion runs", () => {
    const state = {
      ...ONLINE,
      neutral_needed: { code: "motion_running", text: "nothing drives during a motion" },
    };
    const runs = { ...state, motion: { number: 1, motion: "wave" } };
    expect(banner({ ...WELL, state: runs, asksNeutral: true })).toBeNull();
    expect(banner({ ...WELL, state: { ...state, motion: null }, asksNeutral: true }).text).toBe(
      "Nothing drives during a motion.",
    );
  });
});
