import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Notices } from "../../static/js/notices.js";

beforeEach(() => vi.useFakeTimers());
afterEach(() => vi.useRealTimers());

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
