import { describe, expect, it } from "vitest";
import { controlWords } from "../../../../static/js/control/status/control_words.js";

const CONTROL = { state: "free", holder: null, asking: null, may_take_over: false, refusal: null };

describe("the offered control actions", () => {
  it("are to take free control, or a reason why not", () => {
    expect(controlWords(CONTROL).actions).toEqual(["take"]);
    const refused = controlWords({ ...CONTROL, refusal: { text: "Observers may not drive." } });
    expect(refused).toMatchObject({ actions: [], reason: "Observers may not drive." });
  });

  it("are to ask the holder, or to withdraw the request", () => {
    const other = { ...CONTROL, state: "other", holder: "Bo" };
    expect(controlWords(other)).toMatchObject({ headline: "Bo has control", actions: ["ask"] });
    expect(controlWords({ ...other, asking: 0 }).actions).toEqual(["ask_cancel"]);
    expect(controlWords({ ...other, may_take_over: true }).actions).toEqual(["ask", "take_over"]);
  });

  it("are to take a robot that is offered, or to wait for it", () => {
    const offer = controlWords({ ...CONTROL, asking: 3, ahead: 0, offer_s: 29.5 }, null, 29.5);
    expect(offer).toMatchObject({ headline: "It is your turn", actions: ["take", "ask_cancel"] });
    expect(offer.reason).toContain("within 30 s");
    const refusal = { code: "next_in_line", text: "Bo is next." };
    const next = { ...CONTROL, refusal };
    expect(controlWords(next)).toMatchObject({ actions: ["ask"], reason: "Bo is next." });
    const waits = controlWords({ ...next, asking: 4, ahead: 2 });
    expect(waits).toMatchObject({ actions: ["ask_cancel"] });
    expect(waits.reason).toBe("You wait in line: 2 people are before you. Bo is next.");
  });

  it("are to keep or release your own control", () => {
    expect(controlWords({ ...CONTROL, state: "yours" }).actions).toEqual(["renew", "release"]);
  });

  it("without news of the robot, are those that work, and the words do not promise that you can drive", () => {
    const silent = (who) => controlWords({ ...CONTROL, state: "yours" }, null, null, who);
    expect(silent("robot").headline).toBe("No contact: you cannot drive");
    expect(silent("robot").actions).toEqual(["renew", "release"]);
    expect(silent("console").actions).toEqual(["release"]); // nobody would answer "More time"
  });

  it("count the seconds until a vanished holder loses it", () => {
    const away = { ...CONTROL, state: "away", holder: "Bo" };
    expect(controlWords(away, 6.2).reason).toBe(
      "Their page is gone. Free in 7 s unless it returns.",
    );
    expect(controlWords(away).reason).toBe("Their page is gone.");
  });
});
