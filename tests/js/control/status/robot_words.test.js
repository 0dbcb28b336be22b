import { describe, expect, it } from "vitest";
import { controlWords } from "../../../../static/js/control/control_words.js";
import {
  banner,
  connectionFact,
  isHeld,
  limitsOf,
  stopText,
  verdictText,
} from "../../../../static/js/control/status/robot_words.js";
import { firstShare, paceText, sharesUpTo } from "../../../../static/js/drive/driving_options.js";

const CLEAR = { state: "clear", by: null, reason: "", standstill_ms: null };
const ONLINE = { phase: "online", text: "", stop: CLEAR, neutral_needed: null };
const WELL = {
  connected: true,
  gone: null,
  state: ONLINE,
  sinceViewMs: 50,
  asksNeutral: false,
};
const CONTROL = { state: "free", holder: null, asking: null, may_take_over: false, refusal: null };

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

describe("the verdict in words", () => {
  it("is silent when the gate does nothing", () => {
    expect(verdictText({ code: "free", text: "free" })).toBe("");
    expect(verdictText({ code: "idle", text: "" })).toBe("");
  });

  it("is the gate's own line otherwise", () => {
    expect(
      verdictText({ code: "obstacle", text: "slowed to 0.2 m/s: laser, 0.6 m ahead left" }),
    ).toContain("ahead left");
  });

  it("tells a held robot from a slowed one and an idle one", () => {
    expect(isHeld({ asked: [0.4, 0, 0], allowed: [0, 0, 0] })).toBe(true);
    expect(isHeld({ asked: [0.4, 0, 0], allowed: [0.1, 0, 0] })).toBe(false);
    expect(isHeld({ asked: [0, 0, 0], allowed: [0, 0, 0] })).toBe(false);
    expect(isHeld({ code: "recording", asked: [0.4, 0, 0], allowed: [0, 0, 0] })).toBe(false);
  });
});

describe("the speed limits", () => {
  const limits = [
    { code: "arm_away", text: "held to 0.2 m/s: the arm is away from home", mps: 0.2 },
    { code: "blind_direction", text: "held to 0.3 m/s to the left", mps: 0.3, way: "left" },
    { code: "blind_direction", text: "held to 0.3 m/s to the right", mps: 0.3, way: "right" },
  ];
  const holding = (verdict) =>
    limitsOf({ ...verdict, limits })
      .filter(({ holds }) => holds)
      .map(({ text }) => text);

  it("match a verdict by code and way, not by words", () => {
    expect(holding({ code: "arm_away", text: "Auf 0,2 m/s begrenzt" })).toEqual([limits[0].text]);
    expect(holding({ code: "blind_direction", way: "right", text: "" })).toEqual([limits[2].text]);
  });

  it("do not match another rule, or another way of the same", () => {
    expect(holding({ code: "blind_direction", way: "turn", text: limits[1].text })).toEqual([]);
    expect(holding({ code: "free", text: "" })).toEqual([]);
    expect(limitsOf({ code: "idle", text: "" })).toEqual([]);
  });
});

describe("the offered control actions", () => {
  it("are to take free control, or a reason why not", () => {
    expect(controlWords(CONTROL).actions).toEqual(["take"]);
    const refused = controlWords({ ...CONTROL, refusal: { text: "Observers may not drive." } });
    expect(refused).toMatchObject({ actions: [], reason: "Observers may not drive." });
  });

  it("are to ask the holder, or to withdraw the request", () => {
    const other = { ...CONTROL, state: "other", holder: "Bo" };
    expect(controlWords(other)).toMatchObject({ headline: "Bo has control", actions: ["ask"] });
    expect(controlWords({ ...other, asking: 0 }).actions).toEqual(["ask_cancel"]);
    expect(controlWords({ ...other, may_take_over: true }).actions).toEqual(["ask", "take_over"]);
  });

  it("are to take a robot that is offered, or to wait for it", () => {
    const offer = controlWords({ ...CONTROL, asking: 3, ahead: 0, offer_s: 29.5 }, null, 29.5);
    expect(offer).toMatchObject({ headline: "It is your turn", actions: ["take", "ask_cancel"] });
    expect(offer.reason).toContain("within 30 s");
    const refusal = { code: "next_in_line", text: "Bo is next." };
    const next = { ...CONTROL, refusal };
    expect(controlWords(next)).toMatchObject({ actions: ["ask"], reason: "Bo is next." });
    const waits = controlWords({ ...next, asking: 4, ahead: 2 });
    expect(waits).toMatchObject({ actions: ["ask_cancel"] });
    expect(waits.reason).toBe("You wait in line: 2 people are before you. Bo is next.");
  });

  it("are to keep or release your own control", () => {
    expect(controlWords({ ...CONTROL, state: "yours" }).actions).toEqual(["renew", "release"]);
  });

  it("count the seconds until a vanished holder loses it", () => {
    const away = { ...CONTROL, state: "away", holder: "Bo" };
    expect(controlWords(away, 6.2).reason).toBe(
      "Their page is gone. Free in 7 s unless it returns.",
    );
    expect(controlWords(away).reason).toBe("Their page is gone.");
  });
});

describe("the speeds offered", () => {
  it("go in fifths up to the robot's own limit", () => {
    expect(sharesUpTo(1)).toEqual([0.2, 0.4, 0.6, 0.8, 1]);
    expect(sharesUpTo(0.5)).toEqual([0.2, 0.4, 0.5]);
    expect(sharesUpTo(0.1)).toEqual([0.1]);
  });

  it("begin with the largest that is not above the robot's default", () => {
    expect(firstShare([0.2, 0.4, 0.6], 0.5)).toBe(0.4);
    expect(firstShare([0.2, 0.4, 0.6], 0.4)).toBe(0.4);
    expect(firstShare([0.2, 0.4], 0.1)).toBe(0.2);
  });

  it("are named by walking speeds", () => {
    expect([0.2, 0.4, 0.8, 1, 3].map(paceText)).toEqual([
      "very slow",
      "slow",
      "a stroll",
      "walking pace",
      "faster than walking",
    ]);
  });
});

describe("the connection", () => {
  const good = { connected: true, gone: null, heard: true, stale: false };

  it.each([
    [{}, "Connected", "ok"],
    [{ stale: true }, "No news", "fail"],
    [{ stale: true, heard: false }, "Connecting", "warn"],
    [{ gone: { text: "away" }, heard: false }, "No link", "fail"],
    [{ connected: false, gone: { text: "away" } }, "Offline", "fail"],
  ])("is called by what came of it (%o: %s)", (now, text, level) => {
    expect(connectionFact({ ...good, ...now })).toEqual({ level, text });
  });
});
