import { describe, expect, it } from "vitest";
import { cardOf } from "../../static/js/fleet.js";

describe("a card", () => {
  const state = {
    phase: "online",
    text: "",
    stop: { state: "clear", by: null, reason: "", standstill_ms: null },
    verdict: { code: "idle", text: "", limits: [] },
    battery_percent: 83.6,
    charging: true,
    holder: null,
  };

  it("says how the robot is", () => {
    expect(cardOf({ state, refusal: null })).toMatchObject({
      level: "ok",
      status: "Online",
      battery: "84 %, charging",
      driver: "Nobody",
      gate: "Free",
      stop: "Clear",
    });
  });

  it("says why a robot is not there", () => {
    const refusal = { text: "Its bridge does not answer." };
    expect(cardOf({ state: null, refusal })).toMatchObject({ level: "fail", why: refusal.text });
    const waiting = { ...state, phase: "waiting", text: "No master." };
    expect(cardOf({ state: waiting, refusal: null })).toMatchObject({
      level: "warn",
      why: "No master.",
    });
  });

  it("says who stopped it and what the robot made of it", () => {
    const stop = { state: "stopped", by: "Bo", reason: "", standstill_ms: 300 };
    expect(cardOf({ state: { ...state, stop }, refusal: null })).toMatchObject({
      stop: "Stopped",
      stopped: true,
      stopWhy: "by Bo. Standstill confirmed after 300 ms.",
    });
  });
});
