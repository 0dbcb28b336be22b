import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { languageChoices, languageName } from "../../../static/js/lib/languages.js";
import { whenText } from "../../../static/js/lib/times.js";
import { History, outcomeText } from "../../../static/js/tasks/history.js";
import { Phrases } from "../../../static/js/tasks/phrases.js";
import { aroundWord, Running } from "../../../static/js/tasks/running.js";
import { Say, speechEndNotice } from "../../../static/js/tasks/say.js";

function made(tags) {
  return Object.fromEntries(
    Object.entries(tags).map(([name, tag]) => [name, document.createElement(tag)]),
  );
}

function answering(...bodies) {
  const answers = bodies.map((body) => ({ ok: body !== null, json: async () => body }));
  return vi.fn(async () => answers.shift());
}

describe("languages", () => {
  it("are shown by name, the robot's own first", () => {
    expect(languageName("es", "en")).toBe("Spanish");
    expect(languageName("not a code", "en")).toBe("not a code");
    expect(languageName("en-abc1", "en-abc1")).toBe("en-abc1"); // valid as a language of a profile
    const choices = languageChoices(["es-ES", "en-GB"], "en");
    expect(choices.slice(0, 2).map(({ code }) => code)).toEqual(["es-ES", "en-GB"]);
    expect(choices.filter(({ code }) => code.startsWith("es"))).toHaveLength(1);
    expect(choices.length).toBeGreaterThan(50);
    expect(choices.find(({ code }) => code === "ca-ES")).toMatchObject({
      name: "Catalan (Spain)",
      own: false,
    });
  });
});

describe("a written text", () => {
  let parts;
  let send;
  let form;
  const write = (text) => {
    parts["say-text"].value = text;
    parts["say-text"].dispatchEvent(new Event("input"));
  };
  const press = (key, options = {}) =>
    parts["say-text"].dispatchEvent(new KeyboardEvent("keydown", { key, ...options }));

  beforeEach(() => {
    localStorage.clear();
    parts = made({
      "say-text": "textarea",
      "say-form": "form",
      "say-count": "span",
      "say-send": "button",
      "say-hint": "span",
      "say-fault": "p",
      language: "button",
      "language-name": "span",
      "language-box": "div",
      "language-list": "div",
    });
    parts["language-box"].hidden = true;
    parts["say-form"].append(parts["say-text"], parts["say-send"]);
    document.body.append(parts["say-form"]);
    send = vi.fn(async () => null);
    form = new Say(parts, send);
    form.languages = ["es-ES", "en-GB"];
    form.mayAct = true;
  });
  afterEach(() => {
    form.close();
    parts["say-form"].remove();
  });

  it("is sent by Enter in the first language; the field clears", async () => {
    write("Hola");
    press("Enter");
    expect(send).toHaveBeenCalledWith({ t: "say", text: "Hola", language: "es-ES" });
    await vi.waitFor(() => expect(parts["say-text"].value).toBe(""));
  });

  it("is not sent by Shift+Enter, nor while composing", () => {
    write("Hola");
    press("Enter", { shiftKey: true });
    press("Enter", { isComposing: true });
    expect(send).not.toHaveBeenCalled();
  });

  it("is counted, and not sent above 500 characters", () => {
    write("🙂".repeat(500));
    expect(parts["say-count"].textContent).toBe("500 / 500");
    expect(parts["say-send"].getAttribute("aria-disabled")).toBeNull();
    write(`${"x".repeat(500)}\n`);
    expect(parts["say-send"].getAttribute("aria-disabled")).toBeNull();
    write("x".repeat(501));
    expect(parts["say-count"].dataset.over).toBe("true");
    press("Enter");
    expect(send).not.toHaveBeenCalled();
    expect(parts["say-fault"].textContent).toContain("500");
  });

  it("stays in the field when the robot refuses it", async () => {
    const answer = Promise.resolve({ code: "speaking", text: "Ann has it speak." });
    send.mockReturnValue(answer);
    write("Hola");
    press("Enter");
    await answer;
    expect(parts["say-text"].value).toBe("Hola");
    expect(parts["say-fault"].hidden).toBe(true);
    press("Enter");
    expect(send).toHaveBeenCalledTimes(2);
  });

  it("is sent once while Enter is held", () => {
    send.mockReturnValue(new Promise(() => {}));
    write("Hola");
    press("Enter");
    press("Enter", { repeat: true });
    expect(send).toHaveBeenCalledTimes(1);
  });

  it("is refused without audible text, until the next letter", () => {
    for (const silent of ["", " \n", "\u200b"]) {
      write(silent);
      press("Enter");
      expect(parts["say-fault"].hidden).toBe(false);
      expect(parts["say-text"].getAttribute("aria-invalid")).toBe("true");
    }
    write("H");
    expect(parts["say-fault"].hidden).toBe(true);
    expect(parts["say-text"].getAttribute("aria-invalid")).toBe("false");
    expect(send).not.toHaveBeenCalled();
  });

  it("is refused with control characters, which are selected", () => {
    write(" 🙂a\u0007b\tc");
    press("Enter");
    expect(send).not.toHaveBeenCalled();
    expect(parts["say-fault"].textContent).toBe(
      "Character 3 (U+0007) cannot be spoken: delete it.",
    );
    expect([parts["say-text"].selectionStart, parts["say-text"].selectionEnd]).toEqual([4, 5]);
    write("🙂\tb\nc");
    press("Enter");
    expect(send).toHaveBeenCalledTimes(1);
  });

  it("needs control", () => {
    form.mayAct = false;
    write("Hola");
    press("Enter");
    expect(send).not.toHaveBeenCalled();
    expect(parts["say-fault"].textContent).toContain("Take control");
  });

  it("warns beforehand when control or a voice is missing", () => {
    const { "say-hint": hint, "say-send": button } = parts;
    form.mayAct = null;
    expect([hint.hidden, button.getAttribute("aria-disabled")]).toEqual([true, "true"]);
    form.mayAct = false;
    expect(hint.textContent).toContain("Take control");
    form.mute = "No node on the robot subscribes to /tts/goal.";
    form.mayAct = true;
    expect(hint.textContent).toContain("No node on the robot subscribes");
    expect(button.getAttribute("aria-disabled")).toBe("true");
    write("Hola");
    press("Enter");
    expect(send).not.toHaveBeenCalled();
    expect(parts["say-fault"].textContent).toContain("No node on the robot subscribes");
    form.mute = "";
    expect([hint.hidden, button.getAttribute("aria-disabled")]).toEqual([true, null]);
  });

  it("has a language that people find by its native name", () => {
    parts.language.click();
    const search = parts["language-list"].querySelector("input");
    search.value = "português";
    search.dispatchEvent(new Event("input"));
    search.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter" }));
    expect(form.language).toBe("pt-BR");
  });

  it("uses the chosen language, now and next time", () => {
    parts.language.click();
    const search = parts["language-list"].querySelector("input");
    search.value = "catal";
    search.dispatchEvent(new Event("input"));
    search.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter" }));
    expect(parts["language-name"].textContent).toBe("Catalan (Spain)");
    expect(parts["language-box"].hidden).toBe(true);
    expect(parts["say-text"].lang).toBe("ca-ES");
    expect(form.language).toBe("ca-ES");
  });
});

describe("phrases", () => {
  const PHRASES = [
    { id: 1, text: "Hello!", language: "en", tags: ["greeting"] },
    { id: 2, text: "مرحبا", language: "ar", tags: ["greeting"] },
    { id: 3, text: "Goodbye.", language: "en", tags: [] },
  ];

  it("are buttons in their own script, by language", async () => {
    vi.stubGlobal("fetch", answering({ phrases: PHRASES }));
    const parts = made({ "phrase-list": "div", "phrases-none": "p" });
    const send = vi.fn();
    const phrases = new Phrases(parts, "/phrases/", send);
    phrases.mayAct = true;
    await phrases.load();
    const buttons = [...parts["phrase-list"].querySelectorAll("button")];
    expect(buttons.map(({ textContent }) => textContent)).toEqual(["Hello!", "Goodbye.", "مرحبا"]);
    expect(buttons[2]).toMatchObject({ lang: "ar", dir: "auto" });
    buttons[2].click();
    expect(send).toHaveBeenCalledWith({ t: "say", text: "مرحبا", language: "ar" });
    phrases.mayAct = false;
    expect(buttons.every((button) => button.getAttribute("aria-disabled"))).toBe(true);
    phrases.mayAct = true;
    phrases.mute = "This robot has no voice.";
    expect(buttons.every((button) => button.getAttribute("aria-disabled"))).toBe(true);
    expect(parts["phrases-none"].textContent).toBe("This robot has no voice.");
  });

  it("say so when they cannot be read", async () => {
    vi.stubGlobal("fetch", answering(null));
    const parts = made({ "phrase-list": "div", "phrases-none": "p" });
    await new Phrases(parts, "/phrases/", vi.fn()).load();
    expect(parts["phrases-none"].hidden).toBe(false);
  });
});

describe("the history", () => {
  const entry = (number, topic) => ({
    number,
    text: `Text ${number}`,
    language: "es",
    topic,
    who: "Ann",
    at: "2026-11-21T10:00:00Z",
    outcome: "done",
    why: "",
  });

  it("marks the chosen topic, repeats a text on its own topic", async () => {
    vi.stubGlobal(
      "fetch",
      answering(
        { entries: [entry(9, "/tts"), entry(8, "/other")], more: true },
        { entries: [entry(3, "/tts")], more: false },
      ),
    );
    const parts = made({ "history-list": "div", "history-none": "p", "history-more": "button" });
    const send = vi.fn();
    const history = new History(parts, "/speech/", send);
    history.mayAct = true;
    history.topic = "/tts";
    await history.load();
    const rows = () => [...parts["history-list"].querySelectorAll(".hit")];
    expect(rows().map(({ dataset }) => dataset.here)).toEqual(["true", undefined]);
    rows()[1].querySelector("button").click();
    const repeated = { t: "say", text: "Text 8", language: "es", topic: "/other" };
    expect(send).toHaveBeenCalledWith(repeated);
    expect(parts["history-more"].hidden).toBe(false);
    parts["history-more"].click();
    await vi.waitFor(() => expect(rows()).toHaveLength(3));
    expect(fetch).toHaveBeenLastCalledWith("/speech/?limit=50&before=8", expect.anything());
    expect(parts["history-more"].hidden).toBe(true);
    history.topic = "/other";
    expect(rows().map(({ dataset }) => dataset.here)).toEqual([undefined, "true", undefined]);
  });

  describe("as it grows", () => {
    let parts;
    let history;
    const rows = () => [...parts["history-list"].querySelectorAll(".hit")];
    const texts = () => rows().map((row) => row.querySelector(".hit-name").textContent);
    const saying = (number) => ({ speech: { number }, speech_ended: null });
    const said = (number) => ({
      speech: null,
      speech_ended: { number, outcome: "failed", text: "No voice." },
    });
    const open = (...answers) => {
      vi.stubGlobal("fetch", answering(...answers));
      parts = made({ "history-list": "div", "history-none": "p", "history-more": "button" });
      document.body.append(parts["history-list"]);
      history = new History(parts, "/speech/", vi.fn());
      history.mayAct = true;
    };
    afterEach(() => parts["history-list"].remove());

    it("is read again when a text begins or ends, if visible", async () => {
      const begun = { ...entry(9, "/tts"), outcome: null };
      const answer = { entries: [begun], more: false };
      open(answer, answer, answer);
      history.state = saying(9);
      expect(fetch).not.toHaveBeenCalled();
      history.isShown = true;
      await vi.waitFor(() => expect(rows()[0].textContent).toContain("not over yet"));
      history.state = saying(9);
      expect(fetch).toHaveBeenCalledTimes(1);
      // The robot has reported the end, but the end is not recorded yet.
      history.state = said(9);
      await vi.waitFor(() => expect(rows()[0].textContent).toContain("failed"));
      expect(rows()[0].querySelector(".hit-note").title).toBe("No voice.");
      // A new bridge without history: some ends of the previous bridge may not be recorded.
      history.state = { speech: null, speech_ended: null };
      await vi.waitFor(() => expect(rows()[0].textContent).toContain("end not known"));
    });

    it("keeps requested older entries, and the focus in its row", async () => {
      open(
        { entries: [entry(9), entry(8)], more: true },
        { entries: [entry(7)], more: false },
        { entries: [entry(10), entry(9)], more: true },
        { entries: [entry(20), entry(19)], more: true },
      );
      await history.load();
      rows()[1].querySelector("button").focus();
      parts["history-more"].click();
      await history.load();
      expect(texts()).toEqual(["Text 10", "Text 9", "Text 8", "Text 7"]);
      expect(parts["history-more"].hidden).toBe(true);
      expect(rows()[2].contains(document.activeElement)).toBe(true);
      await history.load(); // there are many new texts: some between the new and the shown texts are missing
      expect(texts()).toEqual(["Text 20", "Text 19"]);
      expect(parts["history-more"].hidden).toBe(false);
    });
  });

  it("says that a deleted text expired, and cannot repeat it", async () => {
    const expired = { ...entry(9, "/tts"), text: "" };
    vi.stubGlobal("fetch", answering({ entries: [expired], more: false }));
    const parts = made({ "history-list": "div", "history-none": "p", "history-more": "button" });
    await new History(parts, "/speech/", vi.fn()).load();
    const row = parts["history-list"].querySelector(".hit");
    expect(row.textContent).toContain("text expired");
    expect(row.querySelector("button")).toBeNull();
  });

  it("tells when and how in words", () => {
    const now = new Date("2026-11-21T12:00:00Z");
    expect(whenText("2026-11-21T10:00:00Z", now)).not.toContain("2026");
    expect(whenText("2026-11-19T10:00:00Z", now)).toContain("2026");
    const parts = new Intl.DateTimeFormat("en", { timeZoneName: "short" }).formatToParts(now);
    const zone = parts.find(({ type }) => type === "timeZoneName").value;
    expect(whenText("2026-11-21T10:00:00Z", now)).toContain(zone);
    expect(outcomeText("done")).toBe("done");
    expect(outcomeText(null)).toBe("not over yet");
  });
});

describe("what is being said", () => {
  it("is split at the spoken word, by characters", () => {
    expect(aroundWord("Hola 🙂 mundo", [7, 12])).toEqual(["Hola 🙂 ", "mundo", ""]);
    expect(aroundWord("Hola", null)).toEqual(["", "", "Hola"]);
  });

  it("is shown with its status and its Cancel, as is a motion", () => {
    const parts = made({
      running: "section",
      "limb-runs": "div",
      "limb-words": "strong",
      "limb-who": "span",
      "limb-cancel": "button",
      "go-runs": "div",
      "go-words": "strong",
      "go-who": "span",
      "go-cancel": "button",
      "drive-runs": "div",
      "drive-words": "strong",
      "drive-who": "span",
      "drive-cancel": "button",
      "motion-runs": "div",
      "motion-name": "strong",
      "motion-who": "span",
      "motion-cancel": "button",
      "speech-runs": "div",
      "speech-status": "strong",
      "speech-who": "span",
      "speech-text": "p",
      "speech-before": "span",
      "speech-word": "mark",
      "speech-after": "span",
      "speech-cancel": "button",
      elsewhere: "div",
    });
    const send = vi.fn();
    const running = new Running(parts, send, (name) => name.toUpperCase());
    running.state = {};
    expect(parts.running.hidden).toBe(true);
    running.mayCancel = true;
    running.state = {
      motion: { name: "wave", who: "Ann" },
      speech: { text: "Hola mundo", language: "es", status: "speaking", word: [5, 10], who: "Bob" },
    };
    expect(parts["motion-name"].textContent).toBe("WAVE");
    expect(parts["motion-who"].textContent).toBe("for Ann");
    expect(parts["speech-status"].textContent).toBe("Speaking");
    expect(parts["speech-who"].textContent).toBe("for Bob");
    expect(parts["speech-word"].textContent).toBe("mundo");
    expect(parts["speech-text"]).toMatchObject({ lang: "es", dir: "auto" });
    parts["motion-cancel"].click();
    parts["speech-cancel"].click();
    expect(send.mock.calls).toEqual([[{ t: "play_cancel" }], [{ t: "say_cancel" }]]);
    running.mayCancel = false;
    expect(parts["speech-cancel"].hidden).toBe(true);
  });

  it("is shown beside a drive by a program, which its holder may cancel", () => {
    const runs = ["drive-runs", "drive-words", "drive-who", "drive-cancel"].flatMap((part) => [
      part,
      part.replace("drive", "go"),
    ]);
    const others = [
      "motion-runs",
      "speech-runs",
      "motion-cancel",
      "speech-cancel",
      "limb-runs",
      "limb-cancel",
    ];
    const parts = made(
      Object.fromEntries(["running", "elsewhere", ...runs, ...others].map((p) => [p, "div"])),
    );
    const send = vi.fn();
    const running = new Running(parts, send, (name) => name);
    const drive = { who: "Ann", goal_m: 2, goal_rad: null, distance_m: 0.52, angle_rad: 0.01 };
    running.state = { drive_by: drive };
    expect(parts.running.hidden).toBe(false);
    expect(parts["drive-words"].textContent).toBe("Drives: 0.5 of 2.0 m");
    expect(parts["drive-who"].textContent).toBe("for Ann");
    running.mayAct = null;
    expect(parts["drive-cancel"].hidden).toBe(true);
    running.mayAct = true;
    expect(parts["drive-cancel"].hidden).toBe(false);
    parts["drive-cancel"].click();
    expect(send).toHaveBeenCalledWith({ t: "drive_by_cancel" });
    running.state = { drive_by: { ...drive, goal_m: null, goal_rad: -1.5708, angle_rad: -0.8 } };
    expect(parts["drive-words"].textContent).toBe("Turns: -46 of -90°");
    running.state = { going: { who: "Bo", left_m: 2.4, since_s: 5, ending: "" } };
    expect(parts["drive-runs"].hidden).toBe(true);
    expect(parts["go-words"].textContent).toBe("Drives to a place: 2.4 m left, 5 s on the way");
    parts["go-cancel"].click();
    expect(send).toHaveBeenCalledWith({ t: "go_cancel" });
    running.state = {};
    expect(parts.running.hidden).toBe(true);
  });

  it("shows redirected input of the tab, and a way back", () => {
    const drives = [
      "drive-runs",
      "drive-cancel",
      "go-runs",
      "go-cancel",
      "limb-runs",
      "limb-cancel",
    ];
    const runs = [...drives, "motion-runs", "motion-cancel", "speech-runs", "speech-cancel"];
    const parts = made(
      Object.fromEntries(["running", "elsewhere", ...runs].map((p) => [p, "div"])),
    );
    const send = vi.fn();
    const running = new Running(parts, send, (name) => name);
    running.mayAct = true;
    running.state = { chosen: { drive: "/phone_vel", speech: "/tts_2" } };
    const shownOn = (tab) => {
      running.tab = tab;
      return [...parts.elsewhere.querySelectorAll("p")].map((p) => p.textContent);
    };
    expect(shownOn("drive")).toEqual(["Drive goes to /phone_vel"]);
    expect(shownOn("centre")).toEqual(["Drive goes to /phone_vel", "Speech goes to /tts_2"]);
    expect(shownOn("motions")).toEqual([]);
    expect(parts.running.hidden).toBe(true);
    shownOn("speech");
    expect(parts.running.hidden).toBe(false);
    parts.elsewhere.querySelector("button").click();
    expect(send).toHaveBeenCalledWith({ t: "choose", use: "speech", topic: null });
    running.mayAct = false;
    expect(parts.elsewhere.querySelector("button")).toBe(null);
  });

  it("is reported when it ends", () => {
    expect(speechEndNotice({ outcome: "done", text: "" }, "Hola")).toMatchObject({
      level: "success",
      text: "Said: “\u2068Hola\u2069”.", // isolates keep the full stop in place after right-to-left text
    });
    expect(speechEndNotice({ outcome: "failed", text: "No voice." }, "Hola")).toMatchObject({
      level: "error",
      text: "The robot failed to say “\u2068Hola\u2069”. No voice.",
    });
    expect(speechEndNotice({ outcome: "unheard", text: "" }, "Hola").level).toBe("warning");
    for (const text of ["Hola.", "¿Qué?", "مرحبا؟", "你好。", "He said “no.”", `${"a".repeat(60)}`])
      expect(speechEndNotice({ outcome: "done", text: "" }, text).text).toMatch(/”$/); // the text's own end mark is enough
  });
});
