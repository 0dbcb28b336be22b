import { describe, expect, it } from "vitest";
import { reasonsOf } from "../../../../static/js/control/reason/reasons.js";
import { silenceOf, silenceText } from "../../../../static/js/control/reason/silence.js";
import { stopText } from "../../../../static/js/control/status/status_text.js";
import { reachDetail } from "../../../../static/js/control/stop/stop_reach.js";

const CLEAR = { state: "clear", by: null, reason: "", standstill_ms: null };
const IDLE = { code: "idle", text: "", asked: [0, 0, 0], allowed: [0, 0, 0] };
const ONLINE = {
  phase: "online",
  text: "",
  stop: CLEAR,
  neutral_needed: null,
  verdict: IDLE,
  unseen_s: 0,
  stands: true,
};
const WELL = {
  connected: true,
  gone: null,
  state: ONLINE,
  sinceViewMs: 50,
  mayClear: true,
  mayAct: true,
};

const reasons = (now) => reasonsOf({ ...WELL, ...now, silence: silenceOf({ ...WELL, ...now }) });
const first = (now) => reasons(now)[0];
const stopped = (more = {}) => ({
  ...ONLINE,
  stop: { ...CLEAR, state: "stopped", by: "Bo", ...more },
});

describe("the silence", () => {
  it("names the nearest part that is silent, and since when", () => {
    const told = (now) => silenceOf({ ...WELL, ...now });
    expect(told({})).toBeNull();
    expect(told({ connected: false }).who).toBe("page");
    expect(told({ gone: { text: "" } }).who).toBe("bridge");
    expect(told({ sinceViewMs: 450 })).toEqual({ who: "console", forMs: 450 });
    expect(told({ sinceViewMs: 450, delayMs: 100 })).toBeNull(); // no news can come faster
    expect(told({ state: { ...ONLINE, unseen_s: 0.4 } })).toEqual({ who: "robot", forMs: 450 });
    expect(told({ state: { ...ONLINE, phase: "waiting", unseen_s: null } }).who).toBe("robot");
    expect(told({ state: null, sinceViewMs: Infinity })).toBeNull(); // not begun
    expect(silenceText({ who: "robot", forMs: 4200 })).toBe("Robot: no answer, 4 s");
  });
});

describe("the reason", () => {
  it("is absent when all is well", () => {
    expect(reasons({})).toEqual([]);
  });

  it("asks to reload an outdated page before all else", () => {
    expect(first({ outdated: true, connected: false })).toMatchObject({ act: "reload" });
  });

  it("says who is silent, and what to do", () => {
    expect(first({ connected: false }).title).toBe("No connection to the server");
    expect(first({ sinceViewMs: 2400 }).title).toBe("The server has not answered for 2 s");
    const frozen = { ...ONLINE, unseen_s: 4.2 };
    expect(first({ state: frozen }).title).toBe("The robot has not answered for 4 s");
    const text = "No ROS master at http://tiago-3:11311.";
    expect(first({ state: { ...ONLINE, phase: "waiting", text } })).toMatchObject({
      title: "The robot is out of reach",
      detail: expect.stringContaining(text),
    });
    expect(first({ gone: { text: "The bridge is not running." } })).toMatchObject({
      title: "No link to the robot",
      detail: expect.stringContaining("The bridge is not running."),
    });
  });

  it("names the person whose stop is pending", () => {
    const pending = { by: "Ann", reason: "", at: Date.now() / 1000 };
    const { level, title, text } = first({ gone: { text: "No bridge." }, pending });
    expect(text).toMatch(
      /^A stop by Ann, .+, waits for the robot and is delivered when it is back\.$/,
    );
    expect([level, title]).toEqual([
      "alarm",
      "A stop is not confirmed: press the red button on the robot",
    ]);
  });

  it.each([
    ["page", { connected: false }, "STOP may not arrive"],
    ["console", { sinceViewMs: 2400 }, "STOP may not arrive"],
    ["bridge", { gone: { text: "No bridge." } }, "STOP may not arrive"],
    ["robot", { state: { ...ONLINE, unseen_s: 4.2 } }, "STOP may not arrive"],
    ["robot", { state: { ...ONLINE, phase: "waiting" } }, "STOP may not arrive"],
    ["robot", { state: { ...ONLINE, phase: "connecting" } }, "STOP may not arrive"],
    ["robot", { state: { ...ONLINE, phase: "refused" } }, "STOP may not arrive"],
  ])("says while the %s is silent whether a stop arrives", (who, now, words) => {
    const { text, detail } = first(now);
    expect(text).toContain(`${words}: if the robot moves, press the red button on the robot.`);
    expect(detail).toContain(reachDetail(who));
  });

  it("says first that a pressed stop is not confirmed", () => {
    const unconfirmed = "No answer to the stop.";
    for (const now of [{}, { connected: false }, { outdated: true }])
      expect(first({ ...now, unconfirmed })).toMatchObject({ level: "alarm", text: unconfirmed });
  });

  it("names the person who stopped, with the button that clears for those who may", () => {
    const state = stopped({ standstill_ms: 411.6 });
    expect(first({ state })).toEqual({
      level: "stop",
      title: "Stopped by Bo",
      text: "Standstill confirmed after 412 ms.",
      act: "clear",
    });
    expect(first({ state, mayClear: false }).act).toBeUndefined();
    const standing = stopped({ was_standing: true });
    expect(first({ state: standing }).text).toBe("The robot was standing.");
    expect(stopText(standing)).toBe("Stopped, was standing");
    const stopping = { ...ONLINE, stop: { ...CLEAR, state: "stopping", by: "Bo" } };
    expect(first({ state: stopping }).text).toContain("not confirmed yet");
  });

  it("says of a stop with silent odometry that nobody knows", () => {
    const state = { ...stopped(), stands: null, unseen_s: 1.5 };
    expect(first({ state }).title).toBe("Stop by Bo: nobody knows whether the robot stands");
    expect(first({ state }).level).toBe("stop"); // it has stood since
    const stopping = { ...state, stop: { ...state.stop, state: "stopping" } };
    expect(first({ state: stopping }).level).toBe("alarm");
    expect(first({ state }).text).toContain("If it moves, press its red button.");
    expect(stopText(state)).toBe("Pressed");
  });

  it("says loudest of all that a stopped robot moves", () => {
    const moves = { parts: ["base"], speed_mps: 0.3, text: "It drives. /rogue on /cmd_vel." };
    const state = { ...stopped(), stands: false, moves_although_stopped: moves };
    expect(first({ state, asksNeutral: true })).toMatchObject({
      level: "alarm",
      title: "It moves although stopped: press the red button on the robot",
      detail: expect.stringContaining("/rogue on /cmd_vel. Stopped by Bo."),
    });
    for (const cut of [{ connected: false }, { gone: { text: "No." } }, { sinceViewMs: 2400 }])
      expect(first({ ...cut, state }).level).toBe("alarm");
    const unknown = {
      ...state,
      stands: null,
      moves_although_stopped: { ...moves, speed_mps: null },
    };
    expect(first({ state: unknown }).title).toContain("nobody knows");
  });

  it("asks for a neutral stick, but not while a motion runs", () => {
    const neutral_needed = { code: "stop_cleared", text: "the stop was cleared" };
    const state = { ...ONLINE, neutral_needed };
    expect(first({ state, asksNeutral: true })).toMatchObject({
      title: "Let the stick return to the middle",
      text: "The stop was cleared.",
    });
    expect(reasons({ state })).toEqual([]);
    expect(reasons({ state: { ...state, motion: { number: 1 } }, asksNeutral: true })).toEqual([]);
  });

  it("counts the others: warnings for staff come last", () => {
    const state = {
      ...ONLINE,
      overload: { part: "bridge", late_s: 0.25 },
      watchdog_missing: true,
    };
    const wish = { level: "warning", title: "You cannot drive yet", act: "take" };
    expect(reasons({ state, wish }).map(({ title }) => title)).toEqual([
      "You cannot drive yet",
      "The server is overloaded",
      "A safety program is missing: keep the red button in reach",
    ]);
    expect(reasons({ state })[0].detail).toContain("The robot’s bridge was 0.3 s late.");
  });
});

describe("the gate's reason", () => {
  const held = (verdict, now = {}) => first({ ...now, state: { ...ONLINE, verdict } });
  const wall = {
    code: "obstacle",
    text: "stopped: laser, 0.1 m ahead",
    asked: [0.4, 0, 0],
    allowed: [0, 0, 0],
    sensor: "laser",
    distance_m: 0.1,
    side: "ahead",
  };

  it("says what is where, and what to do", () => {
    expect(held(wall)).toEqual({
      level: "warning",
      title: "Something is 0.1 m ahead",
      text: "The robot stands. Back off, or turn away from it.",
      act: "back_off",
      detail: wall.text,
    });
    expect(held({ ...wall, side: "behind" }).act).toBeUndefined();
    expect(held({ ...wall, allowed: [0.1, 0, 0] })).toMatchObject({
      level: "info",
      title: "Slower: something is 0.1 m ahead",
    });
    expect(held({ ...wall, sensor: "laser, remembered" }).act).toBe("forget");
    expect(held({ ...wall, code: "mover" }).text).toBe("Wait until the way is free.");
  });

  it("is silent about limits that do not bear on what the hand asks", () => {
    const limits = [
      { code: "blind_direction", way: "reverse", text: "at most 0.1 m/s in reverse" },
    ];
    expect(reasons({ state: { ...ONLINE, verdict: { ...IDLE, limits } } })).toEqual([]);
    const reverse = { ...IDLE, code: "blind_direction", way: "reverse", text: "slow", limits };
    expect(held(reverse).title).toBe("The robot sees nothing on that side");
  });

  it("offers the way out that a rule has", () => {
    const act = (code) => held({ ...wall, code }).act;
    expect([act("behind_unseen"), act("head_away"), act("arm_away")]).toEqual([
      "turn",
      "look",
      "arm_home",
    ]);
  });

  it("blames no camera while the head turns", () => {
    const text = "at most 0.3 m/s: the depth camera’s picture is 0.5 s old (the head is turning)";
    expect(held({ ...wall, code: "depth_stale", text }).title).toBe("Slower: the head is turning");
  });

  it("has the bridge's own sentence for a rule that it does not know", () => {
    expect(held({ ...wall, code: "new_rule" })).toEqual({ level: "warning", title: wall.text });
  });

  it("stays for a moment, quieter, with its button: that needs a stick at rest", () => {
    const recent = { level: "warning", title: "Something is 0.1 m ahead", act: "back_off" };
    expect(first({ recent })).toEqual({ ...recent, level: "info" });
  });

  it("has its button only for a person in control, while the robot does nothing by itself", () => {
    expect(held(wall, { mayAct: false }).act).toBeUndefined();
    const state = { ...ONLINE, verdict: wall, drive_by: { number: 1 } };
    expect(first({ state }).act).toBeUndefined();
  });
});
