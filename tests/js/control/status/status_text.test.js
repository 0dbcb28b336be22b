import { describe, expect, it } from "vitest";
import {
  connectionFact,
  isHeld,
  limitsOf,
  verdictText,
} from "../../../../static/js/control/status/status_text.js";

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
    { code: "arm_away", text: "at most 0.2 m/s: the arm is away from home", mps: 0.2 },
    { code: "blind_direction", text: "at most 0.3 m/s to the left", mps: 0.3, way: "left" },
    { code: "blind_direction", text: "at most 0.3 m/s to the right", mps: 0.3, way: "right" },
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

describe("the connection", () => {
  const good = { connected: true, gone: null, received: true, stale: false };

  it.each([
    [{}, "Connected", "ok"],
    [{ stale: true }, "No news", "fail"],
    [{ stale: true, received: false }, "Connecting", "warn"],
    [{ gone: { text: "away" }, received: false }, "No link", "fail"],
    [{ connected: false, gone: { text: "away" } }, "Offline", "fail"],
  ])("is called by what came of it (%o: %s)", (now, text, level) => {
    expect(connectionFact({ ...good, ...now })).toEqual({ level, text });
  });
});
