import { beforeEach, describe, expect, it, vi } from "vitest";
import { Endings, NewEnds } from "../../../static/js/tasks/task_ends.js";

describe("ends of tasks", () => {
  let notify;
  let ends;

  beforeEach(() => {
    notify = vi.fn();
    ends = new Endings(notify);
    ends.follow(null, { number: 4, outcome: "done" });
  });

  it("are reported once, to the page that began the task", () => {
    ends.begin();
    ends.follow("Hola", { number: 4, outcome: "done" });
    expect(ends.follow(null, { number: 5, outcome: "failed" })).toBe(true);
    expect(ends.follow(null, { number: 5, outcome: "failed" })).toBe(false);
    expect(notify.mock.calls).toEqual([[{ number: 5, outcome: "failed" }, "Hola"]]);
  });

  it("carry the task's name; a refused task has no end", () => {
    const undo = ends.begin("Hola");
    ends.follow(null, { number: 5, outcome: "done" });
    undo();
    ends.begin("Adios")();
    ends.follow(null, { number: 6, outcome: "done" });
    expect(notify.mock.calls).toEqual([[{ number: 5, outcome: "done" }, "Hola"]]);
  });

  it("do not name the person to the page that cancelled", () => {
    const cancelled = { outcome: "cancelled", text: "Its holder cancelled it." };
    const cancel = () => ends.begin(undefined, true);
    ends.begin("Hola");
    cancel()();
    ends.follow(null, { number: 5, ...cancelled });
    cancel();
    ends.follow(null, { number: 6, ...cancelled });
    cancel();
    ends.follow(null, { number: 7, outcome: "stopped", text: "Bo stopped the robot." });
    ends.begin("Adios");
    ends.follow(null, { number: 8, ...cancelled });
    expect(notify.mock.calls.map(([{ text }]) => text)).toEqual([
      "Its holder cancelled it.",
      "",
      "Bo stopped the robot.",
      "Its holder cancelled it.",
    ]);
  });

  it("are not reported for other people's or earlier tasks", () => {
    expect(ends.follow(null, { number: 5, outcome: "done" })).toBe(true);
    expect(notify).not.toHaveBeenCalled();
  });

  it("are reported as unheard when the bridge ended", () => {
    ends.begin();
    ends.follow("wave", { number: 4, outcome: "done" });
    ends.lost();
    expect(ends.follow(null, null)).toBe(true);
    ends.follow(null, null);
    ends.lost();
    ends.follow(null, null);
    expect(notify.mock.calls).toEqual([[{ outcome: "unheard", text: "" }, "wave"]]);
  });

  it("are reported after a lost connection", () => {
    ends.begin();
    ends.follow("wave", { number: 4, outcome: "done" });
    ends.lost();
    expect(ends.follow("wave", { number: 4, outcome: "done" })).toBe(false);
    ends.lost();
    expect(ends.follow(null, { number: 5, name: "wave", outcome: "succeeded" })).toBe(true);
    expect(notify.mock.calls).toEqual([
      [{ number: 5, name: "wave", outcome: "succeeded" }, "wave"],
    ]);
  });

  it("use the robot's names", () => {
    ends.begin();
    ends.follow(null, { number: 5, name: "wave", outcome: "succeeded" });
    expect(notify.mock.calls[0][1]).toBe("wave");
  });
});

describe("chosen topics that vanish", () => {
  it("are reported once each, but not from before the page", () => {
    const texts = [];
    const ends = new NewEnds(({ text }) => texts.push(text));
    const speech = { number: 4, text: "/say is gone." };
    ends.follow({ speech });
    ends.follow({ speech });
    expect(texts).toEqual([]);
    const drive = { number: 9, text: "/phone_vel is gone." };
    ends.follow({ speech, drive });
    ends.follow({ speech, drive });
    ends.follow({ speech, drive: { ...drive, number: 12 } });
    expect(texts).toEqual(["/phone_vel is gone.", "/phone_vel is gone."]);
  });
});
