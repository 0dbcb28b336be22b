import { beforeEach, describe, expect, it, vi } from "vitest";
import { durationText, endNotice, Motions } from "../../../static/js/tasks/motions.js";

const WAVE = { name: "wave", title: "Wave", usage: "demo", description: "A hand", duration_s: 3.2 };
const HOME = { name: "home", title: "Home", usage: "tuck", description: "", duration_s: null };
const BOW = { name: "bow", title: "Bow", usage: "demo" };
const WAVING = { now: { name: "wave", who: "Ann" }, ended: null };

function pageParts() {
  const names = ["motion-list", "motions-none", "motions-hint"];
  const parts = Object.fromEntries(names.map((name) => [name, document.createElement("div")]));
  return { ...parts, "motions-refresh": document.createElement("button") };
}

describe("the list of motions", () => {
  let parts;
  let send;
  let motions;
  const button = (name) =>
    [...parts["motion-list"].querySelectorAll("button")].find((found) =>
      found.textContent.includes(name),
    );

  beforeEach(() => {
    parts = pageParts();
    send = vi.fn();
    motions = new Motions({ parts, request: send, notify: vi.fn() });
    motions.offers = { motions: [WAVE, HOME, BOW] };
  });

  it("shows the robot's own words, by groups", () => {
    const rows = [...parts["motion-list"].querySelectorAll("li")].map((row) => row.textContent);
    expect(rows).toEqual(["demo", "PlayWaveA hand3.2 s", "PlayBow", "tuck", "PlayHome"]);
  });

  it("shows only what a lesson leaves", () => {
    motions.tasks = { motions: ["wave"] };
    expect(button("Wave")).toBeDefined();
    expect(button("Bow")).toBeUndefined();
    motions.tasks = null;
    expect(button("Bow")).toBeDefined();
  });

  it("plays what is pressed, and cancels it in the same place", () => {
    motions.mayAct = motions.mayCancel = true;
    button("Wave").click();
    expect(send).toHaveBeenLastCalledWith({ t: "play", motion: "wave", title: "Wave" });
    motions.motion = WAVING;
    expect(button("Wave").firstElementChild.textContent).toBe("Cancel");
    button("Wave").click();
    expect(send).toHaveBeenLastCalledWith({ t: "play_cancel" });
    motions.motion = { now: null, ended: null };
    expect(button("Wave").firstElementChild.textContent).toBe("Play");
  });

  it("does not cancel on the second press of a double click", () => {
    motions.mayAct = motions.mayCancel = true;
    motions.motion = WAVING;
    button("Wave").dispatchEvent(new MouseEvent("click", { detail: 2 }));
    expect(send).not.toHaveBeenCalled();
  });

  it("reads a press right after the end as a cancel", () => {
    motions.mayAct = motions.mayCancel = true;
    const clock = vi.spyOn(performance, "now").mockReturnValue(1000);
    motions.motion = WAVING;
    motions.motion = { now: null, ended: null };
    clock.mockReturnValue(1300);
    button("Wave").click();
    expect(send).toHaveBeenLastCalledWith({ t: "play_cancel" });
    button("Bow").click();
    expect(send).toHaveBeenLastCalledWith({ t: "play", motion: "bow", title: "Bow" });
    clock.mockReturnValue(1600);
    button("Wave").click();
    expect(send).toHaveBeenLastCalledWith({ t: "play", motion: "wave", title: "Wave" });
    clock.mockRestore();
  });

  it("takes a held key as one press, also in the search", () => {
    motions.mayAct = motions.mayCancel = true;
    const held = () =>
      new KeyboardEvent("keydown", { key: "Enter", repeat: true, bubbles: true, cancelable: true });
    const onMotion = held();
    button("Wave").dispatchEvent(onMotion);
    expect(onMotion.defaultPrevented).toBe(true);
    const field = parts["motion-list"].querySelector("input");
    field.value = "wave";
    field.dispatchEvent(new Event("input"));
    field.dispatchEvent(held());
    expect(send).not.toHaveBeenCalled();
  });

  it("keeps room for the button's other word", () => {
    const act = button("Wave").firstElementChild;
    expect([act.textContent, act.dataset.later]).toEqual(["Play", "Cancel"]);
    motions.motion = WAVING;
    expect([act.textContent, act.dataset.later]).toEqual(["Cancel", "Play"]);
  });

  it("sends a second motion, which the robot then refuses", () => {
    motions.mayAct = motions.mayCancel = true;
    motions.motion = WAVING;
    button("Bow").click();
    expect(send).toHaveBeenCalledWith({ t: "play", motion: "bow", title: "Bow" });
  });

  it("looks disabled without control; supervisors may cancel", () => {
    motions.mayAct = false;
    motions.mayCancel = true;
    motions.motion = WAVING;
    expect(button("Bow").getAttribute("aria-disabled")).toBe("true");
    expect(parts["motions-hint"].hidden).toBe(false);
    expect(button("Wave").getAttribute("aria-disabled")).toBeNull();
    motions.mayAct = motions.mayCancel = true;
    expect(button("Bow").getAttribute("aria-disabled")).toBeNull();
    expect(parts["motions-hint"].hidden).toBe(true);
    const refusal = { text: "No node on the robot subscribes to /play_motion/goal." };
    motions.offers = { motions: [WAVE, BOW], uses: { motions: { refusal } } };
    expect(button("Bow").getAttribute("aria-disabled")).toBe("true");
    expect(parts["motions-hint"].textContent).toContain("/play_motion/goal");
  });

  it("does not ask to take control before it is known who has it", () => {
    motions.mayAct = null;
    expect(parts["motions-hint"].hidden).toBe(true);
  });

  it("says why there are none, and asks the robot again", () => {
    motions.offers = { motions: [], motions_text: "play_motion does not run." };
    expect(parts["motions-none"].textContent).toBe("play_motion does not run.");
    parts["motions-refresh"].click();
    expect(send).toHaveBeenCalledWith({ t: "refresh" });
  });

  it("knows a motion's display name", () => {
    expect(motions.titleOf("wave")).toBe("Wave");
    expect(motions.titleOf("gone")).toBe("gone");
  });
});

describe("motions in words", () => {
  it("say how one ended, with the robot's reason for a failure", () => {
    const ended = { name: "wave", outcome: "intruder", text: "Laser, 0.3 m ahead." };
    expect(endNotice(ended, "Wave")).toMatchObject({
      level: "warning",
      text: "Wave: cancelled, because something came near. Laser, 0.3 m ahead.",
    });
    const unrecorded = { outcome: "not_recorded", text: "The robot stands still." };
    expect(endNotice(unrecorded, "Wave").text).toBe("Wave: cancelled. The robot stands still.");
    expect(endNotice({ outcome: "succeeded", text: "" }, "Wave").level).toBe("success");
    expect(endNotice({ outcome: "unheard", text: "" }, "Wave").level).toBe("warning");
    expect(endNotice({ outcome: "failed", text: "Code -7." }, "Wave")).toMatchObject({
      level: "error",
      text: "Wave: failed. Code -7.",
    });
  });

  it("say how long one lasts, if the robot knows", () => {
    expect(durationText(3.24)).toBe("3.2 s");
    expect(durationText(12.6)).toBe("13 s");
    expect(durationText(null)).toBe("");
  });
});
