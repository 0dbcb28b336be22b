import { expect, it, vi } from "vitest";
import { DriveBy } from "../../../static/js/drive/drive_by.js";

it("a drive by a distance says why it ended otherwise than wanted", () => {
  const notify = vi.fn();
  const panel = new DriveBy({ notify });
  const ends = (number, outcome) => {
    panel.drive_by = { now: null, ended: { number, seq: number, fence: 1, outcome, text: "Why." } };
  };
  ends(1, "held_back"); // old news
  ends(2, "done");
  ends(3, "replaced");
  expect(notify).not.toHaveBeenCalled();
  ends(4, "held_back");
  ends(4, "held_back");
  expect(notify).toHaveBeenCalledExactlyOnceWith(
    expect.objectContaining({ text: expect.stringContaining("Stopped on its way"), stays: true }),
  );
});
