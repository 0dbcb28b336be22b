import { afterEach, describe, expect, it, vi } from "vitest";
import { randomToken, tabClock, tabToken } from "../../../static/js/lib/tab.js";

describe("the tab", () => {
  afterEach(() => vi.unstubAllGlobals());

  it("has a token and a clock where the browser forbids storage", async () => {
    const refuse = () => {
      throw new DOMException("forbidden", "SecurityError");
    };
    vi.stubGlobal("sessionStorage", new Proxy({}, { get: refuse }));
    expect(await tabToken()).toMatch(/^[0-9a-f]{32}$/);
    expect(tabClock()()).toBeGreaterThan(0);
  });

  it("has a token that the wire format accepts", () => {
    expect(randomToken()).toMatch(/^[A-Za-z0-9_-]{16,64}$/);
    expect(randomToken()).not.toBe(randomToken());
  });

  it("has a clock that continues after a reload", () => {
    sessionStorage.clear();
    const first = tabClock()();
    sessionStorage.setItem("tab-origin", String(performance.timeOrigin - 60_000)); // the tab was opened a minute ago
    expect(tabClock()()).toBeGreaterThanOrEqual(first + 60_000);
  });
});
