import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { languageChoices, languageName } from "../../../static/js/formats/languages.js";
import { whenText } from "../../../static/js/formats/times.js";
import { History, outcomeText } from "../../../static/js/tasks/history.js";
import { Phrases } from "../../../static/js/tasks/phrases.js";
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

const VOICE = { languages: ["es-ES", "en-GB"], uses: { speech: { topic: "/tts" } } };
const ROOT = { dataset: { phrases: "/phrases/", speech: "/speech/" } };

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
    form = new Say({ parts, request: send, notify: vi.fn() });
    form.offers = VOICE;
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
    const refusal = { text: "No node on the robot subscribes to /tts/goal." };
    form.offers = { ...VOICE, uses: { speech: { topic: "/tts", refusal } } };
    form.mayAct = true;
    expect(hint.textContent).toContain("No node on the robot subscribes");
    expect(button.getAttribute("aria-disabled")).toBe("true");
    write("Hola");
    press("Enter");
    expect(send).not.toHaveBeenCalled();
    expect(parts["say-fault"].textContent).toContain("No node on the robot subscribes");
    form.offers = VOICE;
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
    const phrases = new Phrases({ root: ROOT, parts, request: send });
    phrases.mayAct = true;
    await vi.waitFor(() => expect(parts["phrase-list"].querySelector("button")).not.toBeNull());
    const buttons = [...parts["phrase-list"].querySelectorAll("button")];
    expect(buttons.map(({ textContent }) => textContent)).toEqual(["Hello!", "Goodbye.", "مرحبا"]);
    expect(buttons[2]).toMatchObject({ lang: "ar", dir: "auto" });
    buttons[2].click();
    expect(send).toHaveBeenCalledWith({ t: "say", text: "مرحبا", language: "ar" });
    phrases.mayAct = false;
    expect(buttons.every((button) => button.getAttribute("aria-disabled"))).toBe(true);
    phrases.mayAct = true;
    phrases.offers = {};
    expect(buttons.every((button) => button.getAttribute("aria-disabled"))).toBe(true);
    expect(parts["phrases-none"].textContent).toBe("This robot has no voice.");
  });

  it("say so when they cannot be read", async () => {
    vi.stubGlobal("fetch", answering(null));
    const parts = made({ "phrase-list": "div", "phrases-none": "p" });
    new Phrases({ root: ROOT, parts, request: vi.fn() });
    await vi.waitFor(() => expect(parts["phrases-none"].textContent).toContain("not be read"));
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
    const history = new History({ root: ROOT, parts, request: send });
    history.mayAct = true;
    history.offers = VOICE;
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
    history.chosen = { speech: "/other" };
    expect(rows().map(({ dataset }) => dataset.here)).toEqual([undefined, "true", undefined]);
  });

  describe("as it grows", () => {
    let parts;
    let history;
    const rows = () => [...parts["history-list"].querySelectorAll(".hit")];
    const texts = () => rows().map((row) => row.querySelector(".hit-name").textContent);
    const saying = (number) => ({ now: { number }, ended: null });
    const said = (number) => ({
      now: null,
      ended: { number, outcome: "failed", text: "No voice." },
    });
    const open = (...answers) => {
      vi.stubGlobal("fetch", answering(...answers));
      parts = made({ "history-list": "div", "history-none": "p", "history-more": "button" });
      document.body.append(parts["history-list"]);
      history = new History({ root: ROOT, parts, request: vi.fn() });
      history.mayAct = true;
    };
    afterEach(() => parts["history-list"].remove());

    it("is read again when a text begins or ends, if visible", async () => {
      const begun = { ...entry(9, "/tts"), outcome: null };
      const answer = { entries: [begun], more: false };
      open(answer, answer, answer);
      history.speech = saying(9);
      expect(fetch).not.toHaveBeenCalled();
      history.tab = "speech";
      await vi.waitFor(() => expect(rows()[0].textContent).toContain("not over yet"));
      history.speech = saying(9);
      expect(fetch).toHaveBeenCalledTimes(1);
      // The robot has reported the end, but the end is not recorded yet.
      history.speech = said(9);
      await vi.waitFor(() => expect(rows()[0].textContent).toContain("failed"));
      expect(rows()[0].querySelector(".hit-note").title).toBe("No voice.");
      // A new bridge without history: some ends of the previous bridge may not be recorded.
      history.speech = { now: null, ended: null };
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
    await new History({ root: ROOT, parts, request: vi.fn() }).load();
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

describe("a speech", () => {
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
