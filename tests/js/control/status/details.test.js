import { beforeEach, describe, expect, test } from "vitest";
import {
  Details,
  latencyText,
  skewText,
  watchersText,
} from "../../../../static/js/control/status/details.js";
import { STATE } from "./state.js";

test("an unmeasured latency is shown as assumed", () => {
  expect(latencyText({ latency_s: 0.2, latency_measured: false })).toBe("200 ms (assumed)");
  expect(latencyText({ latency_s: 0.113, latency_measured: true })).toBe("113 ms");
});

test("many viewers are shown as some names and a number", () => {
  expect(watchersText({ watchers: [], watchers_more: 0 })).toBe("Nobody");
  expect(watchersText({ watchers: ["Ann", "Bob"], watchers_more: 0 })).toBe("Ann, Bob");
  expect(watchersText({ watchers: ["Ann", "Bob"], watchers_more: 12 })).toBe("Ann, Bob, 12 more");
});

test("a wrong clock is explained in words", () => {
  expect(skewText({ clock_skew_s: null })).toBe("");
  expect(skewText({ clock_skew_s: 3.2 })).toBe("The robot’s clock is 3.2 s ahead of the server’s.");
  expect(skewText({ clock_skew_s: -0.84 })).toBe("The robot’s clock is 0.8 s behind the server’s.");
});

describe("the panel", () => {
  let parts;
  let details;

  beforeEach(() => {
    const names = [
      "details",
      "watchers",
      "sensors",
      "clock",
      "latency",
      "foreign",
      "refusals",
      "all-limits",
      "overload",
      "watchdog",
    ];
    parts = Object.fromEntries(names.map((name) => [name, document.createElement("p")]));
    details = new Details(parts);
  });

  test("shows the clock's line only while the clock is wrong", () => {
    details.state = { ...STATE, clock_skew_s: 3.2 };
    expect(parts.clock.hidden).toBe(false);
    expect(parts.clock.textContent).toContain("3.2 s ahead");
    details.state = STATE;
    expect(parts.clock.hidden).toBe(true);
  });

  test("says which part of the console is late, while it is", () => {
    details.state = { ...STATE, overload: { part: "console", late_s: 0.42 } };
    expect(parts.overload.textContent).toBe("The server was 0.4 s late.");
    details.state = { ...STATE, overload: null };
    expect(parts.overload.hidden).toBe(true);
  });

  test("says that the watchdog is missing, while it is", () => {
    details.state = { ...STATE, watchdog_missing: true };
    expect(parts.watchdog.textContent).toContain("one program alone");
    details.state = STATE;
    expect(parts.watchdog.hidden).toBe(true);
  });

  test("lists the current speed limits, or None", () => {
    const limits = [{ code: "arm_away", text: "at most 0.2 m/s: the arm is away", mps: 0.2 }];
    details.state = { ...STATE, verdict: { limits } };
    expect(parts["all-limits"].textContent).toBe("at most 0.2 m/s: the arm is away");
    details.state = STATE;
    expect(parts["all-limits"].textContent).toBe("None");
  });

  test("counts refused messages by reason, in words", () => {
    details.state = { ...STATE, refused: { too_old: 3 } };
    expect(parts.refusals.textContent).toBe("too old: 3");
  });
});
