import { beforeEach, describe, expect, it, vi } from "vitest";
import { endText, Motions } from "../../static/js/motions.js";

const RUNNING = { name: "wave", who: "Ann", since_s: 2.7 };

describe("the list of motions and its button", () => {
  let parts;
  let send;
  let motions;

  beforeEach(() => {
    parts = {
      motions: document.createElement("section"),
      "motion-choice": document.createElement("select"),
      "motion-play": document.createElement("button"),
      "motion-state": document.createElement("p"),
    };
    parts.motions.hidden = true;
    send = vi.fn();
    motions = new Motions(parts, send);
    motions.state = { motions: ["home", "wave"] };
  });

  it("is there for robots with motions only", () => {
    expect(parts.motions.hidden).toBe(false);
    motions.state = { motions: [] };
    expect(parts.motions.hidden).toBe(true);
  });

  it("plays what is chosen under this tab's control", () => {
    motions.fence = 7;
    parts["motion-choice"].value = "wave";
    motions.state = { motions: ["home", "wave"] };
    parts["motion-play"].click();
    expect(send).toHaveBeenCalledWith({ t: "play", fence: 7, motion: "wave" });
  });

  it("keeps the choice when the robot's list changes", () => {
    motions.fence = 7;
    parts["motion-choice"].value = "wave";
    motions.state = { motions: ["bow", "home", "wave"] };
    expect(parts["motion-choice"].value).toBe("wave");
  });

  it("cancels in the same place while one runs, and says which and for whom", () => {
    motions.fence = 7;
    motions.state = { motions: ["home", "wave"], motion: RUNNING };
    expect(parts["motion-play"].textContent).toBe("Cancel");
    expect(parts["motion-choice"].disabled).toBe(true);
    expect(parts["motion-state"].textContent).toBe("wave, for Ann");
    parts["motion-play"].click();
    expect(send).toHaveBeenCalledWith({ t: "play_cancel", fence: 7 });
  });

  it("asks nothing without control", () => {
    parts["motion-play"].click();
    motions.fence = 7;
    motions.fence = null;
    parts["motion-play"].click();
    expect(send).not.toHaveBeenCalled();
  });

  it("tells how the last one ended", () => {
    const ended = { number: 3, name: "wave", outcome: "intruder", text: "Laser, 0.3 m ahead." };
    motions.state = { motions: ["wave"], motion_ended: ended };
    expect(parts["motion-state"].textContent).toBe("wave: intruder. Laser, 0.3 m ahead.");
    expect(endText({ name: "wave", outcome: "succeeded", text: "" })).toBe("wave: done.");
    expect(endText({ name: "wave", outcome: "failed", text: "" })).toBe("wave: failed.");
  });
});
