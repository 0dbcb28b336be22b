import { describe, expect, it } from "vitest";
import { connectionFact, isHeld } from "../../../../static/js/control/status/status_text.js";

describe("the verdict in words", () => {
  it("tells a held robot from a slowed one and an idle one", () => {
    expect(isHeld({ asked: [0.4, 0, 0], allowed: [0, 0, 0] })).toBe(true);
    expect(isHeld({ asked: [0.4, 0, 0], allowed: [0.1, 0, 0] })).toBe(false);
    expect(isHeld({ asked: [0, 0, 0], allowed: [0, 0, 0] })).toBe(false);
    expect(isHeld({ code: "recording", asked: [0.4, 0, 0], allowed: [0, 0, 0] })).toBe(false);
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
