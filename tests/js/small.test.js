import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Announcer } from "../../static/js/announce.js";
import { SpeedTrace } from "../../static/js/chart.js";
import { Echoes, RoundTrips } from "../../static/js/delay.js";
import { cardOf } from "../../static/js/fleet.js";
import { firstPad } from "../../static/js/gamepad.js";
import { Notices } from "../../static/js/notices.js";
import { randomToken, tabClock } from "../../static/js/tab.js";

beforeEach(() => vi.useFakeTimers());
afterEach(() => vi.useRealTimers());

describe("round trips", () => {
  it("are told by the middle one of the last few, so that one hiccup does not show", () => {
    const trips = new RoundTrips();
    expect(trips.median).toBeNull();
    for (const trip of [8, 9, 400, 10, 8]) trips.add(trip);
    expect(trips.median).toBe(9);
  });

  it("are measured from a number's sending to its first echo", () => {
    const echoes = new Echoes();
    echoes.sent(1, 100);
    echoes.sent(2, 130);
    expect(echoes.heard(2, 150)).toBe(20);
    expect(echoes.heard(2, 180)).toBeNull();
    expect(echoes.heard(1, 190)).toBeNull(); // overtaken
    expect(echoes.heard(null, 200)).toBeNull();
  });
});

describe("announcements", () => {
  it("come at once, then at most every few seconds, and then only the newest", () => {
    const region = document.createElement("p");
    const announcer = new Announcer(region);
    announcer.say("slowed to 0.3 m/s", "slowed ahead");
    expect(region.textContent).toBe("slowed to 0.3 m/s");
    announcer.say("slowed to 0.2 m/s", "slowed ahead"); // only a figure changed
    announcer.say("held: laser, ahead left", "held left");
    announcer.say("held: laser, ahead", "held ahead");
    expect(region.textContent).toBe("slowed to 0.3 m/s");
    vi.advanceTimersByTime(4000);
    expect(region.textContent).toBe("held: laser, ahead");
    announcer.close();
  });
});

describe("notices", () => {
  it("leave by themselves, or when dismissed, and the same one twice is one", () => {
    const list = document.createElement("div");
    const notices = new Notices(list);
    notices.add({ level: "info", code: "asked", text: "Bo asks for control." });
    notices.add({ level: "info", code: "asked", text: "Bo asks for control." });
    notices.add({ level: "warning", code: "other", text: "<b>not markup</b>" });
    expect(list.children).toHaveLength(2);
    expect(list.lastElementChild.querySelector("p").textContent).toBe("<b>not markup</b>");
    list.lastElementChild.querySelector("button").click();
    expect(list.children).toHaveLength(1);
    vi.advanceTimersByTime(6000);
    expect(list.children).toHaveLength(0);
  });
});

describe("the tab", () => {
  it("has a token that the wire takes", () => {
    expect(randomToken()).toMatch(/^[A-Za-z0-9_-]{16,64}$/);
    expect(randomToken()).not.toBe(randomToken());
  });

  it("has a clock that goes on over a reload", () => {
    sessionStorage.clear();
    const first = tabClock()();
    sessionStorage.setItem("tab-origin", String(performance.timeOrigin - 60_000)); // opened a minute ago
    expect(tabClock()()).toBeGreaterThanOrEqual(first + 60_000);
  });
});

describe("the trace of speeds", () => {
  it("keeps the last twenty seconds", () => {
    const trace = new SpeedTrace();
    const state = { verdict: { asked: [0.4, 0, 0], allowed: [0.3, 0, 0] }, odometry: null };
    for (let second = 0; second <= 30; second += 1) trace.add(second, state);
    expect(trace.columns[0][0]).toBe(10);
    expect(trace.columns.map((column) => column.at(-1))).toEqual([30, 0.4, 0.3, null]);
  });
});

describe("the gamepad to obey", () => {
  it("is the first that is connected and has a stick", () => {
    const pad = { connected: true, axes: [0, 0, 0, 0] };
    expect(
      firstPad([null, { connected: false, axes: [0, 0] }, { connected: true, axes: [] }, pad]),
    ).toBe(pad);
    expect(firstPad([null])).toBeNull();
  });
});

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
