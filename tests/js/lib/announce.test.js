import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Announcer } from "../../../static/js/lib/announce.js";

beforeEach(() => vi.useFakeTimers());
afterEach(() => vi.useRealTimers());

describe("announcements", () => {
  it("come at once, then only the newest every few seconds", () => {
    const region = document.createElement("p");
    const announcer = new Announcer(region);
    announcer.announce("slowed to 0.3 m/s", "slowed ahead");
    expect(region.textContent).toBe("slowed to 0.3 m/s");
    announcer.announce("slowed to 0.2 m/s", "slowed ahead"); // only a number changed
    announcer.announce("held: laser, ahead left", "held left");
    announcer.announce("held: laser, ahead", "held ahead");
    expect(region.textContent).toBe("slowed to 0.3 m/s");
    vi.advanceTimersByTime(4000);
    expect(region.textContent).toBe("held: laser, ahead");
    announcer.close();
  });

  it("come again once they ended, never after their end", () => {
    const region = document.createElement("p");
    const announcer = new Announcer(region);
    announcer.announce("No connection. Connecting again.", "No connection");
    announcer.announce("Slowed.", "slowed");
    announcer.forget("No connection"); // a newer text is announced
    announcer.forget("slowed");
    vi.advanceTimersByTime(4000);
    expect(region.textContent).toBe("No connection. Connecting again.");

    region.textContent = "";
    announcer.announce("No connection. Connecting again.", "No connection");
    announcer.forget("No connection");
    vi.advanceTimersByTime(4000);
    announcer.announce("No connection. Connecting again.", "No connection");
    expect(region.textContent).toBe("No connection. Connecting again.");
    announcer.close();
  });
});
