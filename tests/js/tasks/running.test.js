import { beforeEach, describe, expect, it, vi } from "vitest";
import { DriveBy, driveText } from "../../../static/js/drive/drive_by.js";
import { parts } from "../../../static/js/lib/dom.js";
import { goingText } from "../../../static/js/navigation/words.js";
import { Running } from "../../../static/js/tasks/running.js";
import { aroundWord, SpeechLine } from "../../../static/js/tasks/speech_line.js";

const KINDS = {
  ...DriveBy.requests,
  say_cancel: { name: () => "Cancel speech", control: "optional" },
};
const SPEECH = { text: "Hola mundo", language: "es", word: [5, 10], who: "Bob" };

describe("the running tasks", () => {
  let running;
  let send;
  let speech;
  let drive;
  const part = (name) => document.querySelector(`[data-part=${name}]`);

  beforeEach(() => {
    document.body.innerHTML =
      '<section data-part="running"><div data-part="elsewhere"></div></section>';
    send = vi.fn();
    running = new Running(parts(document), send, KINDS);
    drive = running.row("drive_by", new DriveBy({}));
    speech = running.row("speech", {
      line: new SpeechLine(),
      shows: ({ now }) => now && { words: "Speaking", who: now.who, cancel: [{ t: "say_cancel" }] },
    });
  });

  it("are shown while they run, with what is spoken", () => {
    running.mayAct = false;
    expect(part("running").hidden).toBe(true);
    running.mayCancel = true;
    speech({ now: SPEECH });
    expect([part("running").hidden, part("drive_by-runs").hidden]).toEqual([false, true]);
    expect(part("speech-words").textContent).toBe("Speaking");
    expect(part("speech-words").parentElement.getAttribute("role")).toBe("status");
    expect(part("speech-who").textContent).toBe("for Bob");
    expect(part("speech-word").textContent).toBe("mundo");
    expect(part("speech-text")).toMatchObject({ lang: "es", dir: "auto" });
    part("speech-cancel").click();
    expect(send).toHaveBeenCalledWith({ t: "say_cancel" });
    expect(part("speech-cancel").getAttribute("aria-label")).toBe("Cancel speech");
    running.mayCancel = false;
    expect(part("speech-cancel").hidden).toBe(true);
    speech({ now: null });
    expect(part("running").hidden).toBe(true);
  });

  it("can be cancelled with control, once this is known", () => {
    running.mayCancel = true;
    const now = { who: "Ann", goal_m: 2, goal_rad: null, distance_m: 0.52, angle_rad: 0.01 };
    drive({ now });
    expect(part("drive_by-words").textContent).toBe("Drives: 0.5 of 2.0 m");
    for (const may of [null, false]) {
      running.mayAct = may;
      expect(part("drive_by-cancel").hidden).toBe(true);
    }
    running.mayAct = true;
    expect(part("drive_by-cancel").hidden).toBe(false);
    part("drive_by-cancel").click();
    expect(send).toHaveBeenCalledWith({ t: "drive_by_cancel" });
  });

  it("have words", () => {
    const turn = { goal_m: null, goal_rad: -1.5708, distance_m: 0, angle_rad: -0.8 };
    expect(driveText(turn)).toBe("Turns: -46 of -90°");
    expect(goingText({ left_m: 2.4, since_s: 5 })).toBe(
      "Drives to a place: 2.4 m left, 5 s on the way",
    );
    expect(aroundWord("Hola 🙂 mundo", [7, 12])).toEqual(["Hola 🙂 ", "mundo", ""]);
    expect(aroundWord("Hola", null)).toEqual(["", "", "Hola"]);
  });

  it("stand above redirected input of the tab, with a way back", () => {
    running.mayAct = true;
    running.chosen = { drive: "/phone_vel", speech: "/tts_2" };
    const shownOn = (tab) => {
      running.tab = tab;
      return [...part("elsewhere").querySelectorAll("p")].map((p) => p.textContent);
    };
    expect(shownOn("drive")).toEqual(["Drive goes to /phone_vel"]);
    expect(shownOn("centre")).toEqual(["Drive goes to /phone_vel", "Speech goes to /tts_2"]);
    expect(shownOn("motions")).toEqual([]);
    expect(part("running").hidden).toBe(true);
    shownOn("speech");
    expect(part("running").hidden).toBe(false);
    part("elsewhere").querySelector("button").click();
    expect(send).toHaveBeenCalledWith({ t: "choose", use: "speech", topic: null });
    running.mayAct = false;
    expect(part("elsewhere").querySelector("button")).toBe(null);
  });
});
