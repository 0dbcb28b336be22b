import { expect, test, vi } from "vitest";
import { ForgottenNotices, forgottenText } from "../../../../static/js/control/status/forgotten.js";

function followed(...views) {
  const notices = [];
  const forgotten = new ForgottenNotices({ notify: (notice) => notices.push(notice) });
  const clock = vi.spyOn(performance, "now");
  for (const [nowMs, number, code, agoS] of views) {
    clock.mockReturnValue(nowMs);
    forgotten.forgotten = code && { number, code, ago_s: agoS, text: "…" };
  }
  clock.mockRestore();
  return notices.map(({ code, level }) => `${level} ${code}`);
}

test("an event from before the page was opened is no news", () => {
  expect(followed([1000, 3, "jump", 0.2], [1100, 3, "jump", 0.3])).toEqual([]);
});

test("each event is noticed once", () => {
  expect(
    followed(
      [1000, 0, "bridge_started", 60],
      [1100, 1, "jump", 0],
      [1200, 1, "jump", 0.1],
      [1300, 2, "asked", 0],
      [9000, 2, "asked", 7.7],
    ),
  ).toEqual(["warning forgotten jump", "info forgotten asked"]);
});

test("a bridge that starts twice is noticed twice", () => {
  expect(
    followed(
      [1000, 0, "bridge_started", 60],
      [30_000, 0, "bridge_started", 0.4],
      [31_000, 0, "bridge_started", 1.4],
      [60_000, 0, "bridge_started", 0.2],
    ),
  ).toEqual(["warning forgotten bridge_started", "warning forgotten bridge_started"]);
});

test("the words say why, and what to do", () => {
  expect(forgottenText({ code: "jump", text: "" })).toBe(
    "The robot forgot what it saw before: its wheel sensors report another place. Look around before you drive.",
  );
  expect(forgottenText({ code: "asked", text: "" })).not.toContain("Look around");
  expect(forgottenText({ code: "new_code", text: "The robot’s own words." })).toContain(
    "own words",
  );
});
