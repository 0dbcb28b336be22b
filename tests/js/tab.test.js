import { describe, expect, it } from "vitest";
import { randomToken, tabClock } from "../../static/js/tab.js";

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
