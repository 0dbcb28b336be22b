import { beforeEach, describe, expect, it, vi } from "vitest";
import { ChoiceEnds, Endings } from "../../../static/js/tasks/task_ends.js";

describe("endings", () => {
  let tell;
  let ends;

  beforeEach(() => {
    tell = vi.fn();
    ends = new Endings(tell);
    ends.follow(null, { number: 4, outcome: "done" });
  });

  it("are told once, to the page that began it", () => {
    ends.begin();
    ends.follow("Hola", { number: 4, outcome: "done" });
    expect(ends.follow(null, { number: 5, outcome: "failed" })).toBe(true);
    expect(ends.follow(null, { number: 5, outcome: "failed" })).toBe(false);
    expect(tell.mock.calls).toEqual([[{ number: 5, outcome: "failed" }, "Hola"]]);
  });

  it("are named as what was begun, and not told of what was refused", () => {
    const undo = ends.begin("Hola");
    ends.follow(null, { number: 5, outcome: "done" });
    undo();
    ends.begin("Adios")();
    ends.follow(null, { number: 6, outcome: "done" });
    expect(tell.mock.calls).toEqual([[{ number: 5, outcome: "done" }, "Hola"]]);
  });

  it("are told without the words by whom, to the page that cancelled", () => {
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
    expect(tell.mock.calls.map(([{ text }]) => text)).toEqual([
      "Its holder cancelled it.",
      "",
      "Bo stopped the robot.",
      "Its holder cancelled it.",
    ]);
  });

  it("of others are not told, nor one from before this page was opened", () => {
    expect(ends.follow(null, { number: 5, outcome: "done" })).toBe(true);
    expect(tell).not.toHaveBeenCalled();
  });

  it("that nobody tells, because the bridge ended with what ran, are told as unheard", () => {
    ends.begin();
    ends.follow("wave", { number: 4, outcome: "done" });
    ends.lost();
    expect(ends.follow(null, null)).toBe(true);
    ends.follow(null, null);
    ends.lost();
    ends.follow(null, null);
    expect(tell.mock.calls).toEqual([[{ outcome: "unheard", text: "" }, "wave"]]);
  });

  it("are those of what still runs, or has ended meanwhile, after a loss of the connection", () => {
    ends.begin();
    ends.follow("wave", { number: 4, outcome: "done" });
    ends.lost();
    expect(ends.follow("wave", { number: 4, outcome: "done" })).toBe(false);
    ends.lost();
    expect(ends.follow(null, { number: 5, name: "wave", outcome: "succeeded" })).toBe(true);
    expect(tell.mock.calls).toEqual([[{ number: 5, name: "wave", outcome: "succeeded" }, "wave"]]);
  });

  it("are named as the robot names them", () => {
    ends.begin();
    ends.follow(null, { number: 5, name: "wave", outcome: "succeeded" });
    expect(tell.mock.calls[0][1]).toBe("wave");
  });
});

describe("chosen topics that vanish", () => {
  it("are told of once, each time; what was so before this page was opened is old news", () => {
    const told = [];
    const ends = new ChoiceEnds((text) => told.push(text));
    const speech = { number: 4, text: "/say is gone." };
    ends.follow({ speech });
    ends.follow({ speech });
    expect(told).toEqual([]);
    const drive = { number: 9, text: "/phone_vel is gone." };
    ends.follow({ speech, drive });
    ends.follow({ speech, drive });
    ends.follow({ speech, drive: { ...drive, number: 12 } });
    expect(told).toEqual(["/phone_vel is gone.", "/phone_vel is gone."]);
  });
});
