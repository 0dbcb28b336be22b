import { describe, expect, it } from "vitest";
import { sameClock, scrollTime } from "../../../static/js/calendar/calendar_page.js";

const NOW = new Date("2026-03-29T10:30:00Z");

describe("the calendar's clock", () => {
  it("scrolls to two hours before now in the page's zone", () => {
    expect(scrollTime(NOW, "UTC")).toBe("08:00:00");
    expect(scrollTime(NOW, "Asia/Tokyo")).toBe("17:00:00");
    expect(scrollTime(NOW, "America/Los_Angeles")).toBe("01:00:00");
    expect(scrollTime(new Date("2026-03-29T00:30:00Z"), "UTC")).toBe("00:00:00");
  });

  it("marks now only if the browser shows the page's time", () => {
    const own = new Intl.DateTimeFormat().resolvedOptions().timeZone;
    expect(sameClock(NOW, own)).toBe(true);
    expect(sameClock(NOW, "Pacific/Kiritimati")).toBe(false);
    expect(sameClock(NOW, "Pacific/Pago_Pago")).toBe(false);
  });
});
