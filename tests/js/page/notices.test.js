import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Notices } from "../../../static/js/page/notices.js";

function pageParts() {
  const names = ["notices", "said", "alarm", "log-list"];
  const parts = Object.fromEntries(names.map((name) => [name, document.createElement("div")]));
  const dialog = document.createElement("dialog");
  const close = document.createElement("button");
  close.dataset.close = "";
  dialog.append(close);
  dialog.show = () => {
    dialog.open = true;
  };
  return { ...parts, "log-dialog": dialog, "log-open": document.createElement("button") };
}

describe("notices", () => {
  let parts;
  let notices;
  const texts = () =>
    [...parts.notices.querySelectorAll("p > span")].map((text) => text.textContent);

  beforeEach(() => {
    vi.useFakeTimers();
    parts = pageParts();
    notices = new Notices(parts);
  });
  afterEach(() => {
    notices.close();
    vi.useRealTimers();
  });

  it("leave after five seconds, or when dismissed", () => {
    notices.add({ level: "info", code: "asked", text: "Bo asks for control." });
    notices.add({ level: "warning", code: "other", text: "<b>not markup</b>" });
    expect(texts()).toEqual(["<b>not markup</b>", "Bo asks for control."]);
    parts.notices.querySelector("button").click();
    expect(texts()).toEqual(["Bo asks for control."]);
    vi.advanceTimersByTime(4900);
    expect(texts()).toHaveLength(1);
    vi.advanceTimersByTime(200);
    expect(texts()).toEqual([]);
  });

  it("that the page shows otherwise are only logged and read", () => {
    notices.add({ level: "success", code: "take done", text: "You have control.", quiet: true });
    expect(texts()).toEqual([]);
    expect(parts.said.textContent).toContain("You have control.");
    parts["log-open"].click();
    expect(parts["log-list"].textContent).toContain("You have control.");
  });

  it("stay while the pointer is over them", () => {
    notices.add({ level: "info", code: "asked", text: "Bo asks for control." });
    parts.notices.firstElementChild.dispatchEvent(new Event("pointerenter"));
    vi.advanceTimersByTime(60_000);
    expect(texts()).toHaveLength(1);
    parts.notices.firstElementChild.dispatchEvent(new Event("pointerleave"));
    vi.advanceTimersByTime(5100);
    expect(texts()).toEqual([]);
  });

  it("stay while either the focus or the pointer is on them", () => {
    notices.add({ level: "info", code: "asked", text: "Bo asks for control." });
    const shown = parts.notices.firstElementChild;
    for (const type of ["focusin", "pointerenter", "pointerleave"])
      shown.dispatchEvent(new Event(type));
    vi.advanceTimersByTime(60_000);
    for (const type of ["pointerenter", "focusout"]) shown.dispatchEvent(new Event(type));
    vi.advanceTimersByTime(60_000);
    expect(texts()).toHaveLength(1);
    shown.dispatchEvent(new Event("pointerleave"));
    vi.advanceTimersByTime(5100);
    expect(texts()).toEqual([]);
  });

  it("pass the focus on when dismissed, at last to its origin", () => {
    const before = document.createElement("button");
    document.body.replaceChildren(before, parts.notices);
    before.focus();
    notices.add({ level: "info", code: "one", text: "One." });
    notices.add({ level: "info", code: "two", text: "Two." });
    const [two, one] = parts.notices.querySelectorAll(".close");
    two.focus();
    two.click();
    expect(document.activeElement).toBe(one);
    one.click();
    expect(document.activeElement).toBe(before);
  });

  it("end once when dismissed, despite late browser events", () => {
    notices.add({ level: "info", code: "asked", text: "Bo asks for control." });
    const gone = parts.notices.firstElementChild;
    for (const type of ["pointerenter", "focusin"]) gone.dispatchEvent(new Event(type));
    gone.querySelector("button").click();
    for (const type of ["pointerleave", "focusout"]) gone.dispatchEvent(new Event(type));
    vi.advanceTimersByTime(4000);
    notices.add({ level: "info", code: "asked", text: "Bo asks for control." });
    vi.advanceTimersByTime(2000);
    notices.add({ level: "info", code: "asked", text: "Bo asks for control." });
    expect(texts()).toHaveLength(1);
    expect(parts.notices.querySelector(".notice-times").textContent).toBe("×2");
  });

  it("stay under the pointer when repeated or crowded", () => {
    notices.add({ level: "error", code: "busy", text: "Busy." });
    parts.notices.firstElementChild.dispatchEvent(new Event("pointerenter"));
    notices.add({ level: "error", code: "busy", text: "Still busy." });
    for (let i = 0; i < 5; i += 1)
      notices.add({ level: "info", code: `other ${i}`, text: `Other ${i}.` });
    vi.advanceTimersByTime(60_000);
    expect(texts()).toEqual(["Still busy."]);
  });

  it.each([
    ["error", "alarm", "Error: Busy."],
    ["warning", "said", "Warning: Busy."],
  ])("of level %s are announced, quick repeats once", (level, region, words) => {
    const shown = () => [...parts[region].children].map(({ textContent }) => textContent);
    for (let i = 0; i < 5; i += 1) notices.add({ level, code: "busy", text: "Busy." });
    expect(shown()).toEqual([words]);
    vi.advanceTimersByTime(1500);
    expect(shown()).toEqual([]);
    notices.add({ level, code: "busy", text: "Busy." });
    expect(shown()).toEqual([words]);
  });

  it("are announced one by one when they come together", () => {
    notices.add({ level: "warning", code: "busy", text: "Busy." });
    vi.advanceTimersByTime(100);
    notices.add({ level: "success", code: "said", text: "Said." });
    const shown = [...parts.said.children].map(({ textContent }) => textContent);
    expect(shown).toEqual(["Warning: Busy.", "Done: Said."]);
  });

  it("count repeats in one notice", () => {
    for (let i = 0; i < 12; i += 1)
      notices.add({ level: "warning", code: "play busy", text: "Busy." });
    expect(texts()).toEqual(["Busy."]);
    expect(parts.notices.querySelector(".notice-times").textContent).toBe("×12");
    expect(parts.said.textContent).toBe("Warning: Busy.");
  });

  it("show their level by word and sign, errors assertively", () => {
    notices.add({ level: "error", code: "stop", text: "Not confirmed." });
    expect(parts.notices.querySelector(".notice-word").textContent).toBe("Error");
    expect(parts.notices.querySelector(".notice-icon").textContent).toBe("✕");
    expect(parts.alarm.textContent).toBe("Error: Not confirmed.");
    expect(parts.said.textContent).toBe("");
    vi.advanceTimersByTime(1500);
    expect(parts.alarm.textContent).toBe(""); // so that a screen reader reads it once
  });

  it("show at most three at once, and log the last hundred", () => {
    for (let i = 0; i < 120; i += 1)
      notices.add({ level: "success", code: `said ${i}`, text: `Said ${i}.` });
    expect(texts()).toEqual(["Said 119.", "Said 118.", "Said 117."]);
    parts["log-open"].click();
    expect(parts["log-list"].querySelectorAll("li")).toHaveLength(100);
    expect(parts["log-list"].querySelector("li").textContent).toContain("Said 119.");
    const time = parts["log-list"].querySelector("time");
    const parts_of_time = new Intl.DateTimeFormat("en", { timeZoneName: "short" }).formatToParts(
      new Date(),
    );
    expect(time.textContent).toContain(
      parts_of_time.find(({ type }) => type === "timeZoneName").value,
    );
    expect(parts["log-list"].querySelector("ul ~ p:not([hidden])")).toBeNull();
  });

  it("show one at a time on a small screen", () => {
    vi.stubGlobal("matchMedia", (query) => ({ matches: query.startsWith("(max-width") }));
    for (const text of ["One.", "Two.", "Three."]) notices.add({ level: "info", code: text, text });
    expect(texts()).toEqual(["Three."]);
    vi.unstubAllGlobals();
  });

  it("can be searched in the log, where new hits appear", () => {
    parts["log-open"].click();
    const shown = () =>
      [...parts["log-list"].querySelectorAll("li:not([hidden]) p > span")].map(
        (text) => text.textContent,
      );
    expect(parts["log-list"].querySelector("ul ~ p:not([hidden])").textContent).toContain("none");
    notices.add({ level: "warning", code: "a", text: "Wave: cancelled." });
    notices.add({ level: "success", code: "b", text: "Wave: done." });
    const field = parts["log-list"].querySelector("input");
    expect(field.hidden).toBe(false);
    field.value = "WARNING wàve";
    field.dispatchEvent(new Event("input"));
    expect(shown()).toEqual(["Wave: cancelled."]);
    notices.add({ level: "warning", code: "c", text: "Wave: failed." });
    expect(shown()).toEqual(["Wave: failed.", "Wave: cancelled."]);
    field.dispatchEvent(new KeyboardEvent("keydown", { key: "Escape", cancelable: true }));
    expect(shown()).toHaveLength(3);
  });

  it("are logged newest first, also when a repeat is newest", () => {
    notices.add({ level: "info", code: "one", text: "One." });
    notices.add({ level: "info", code: "two", text: "Two." });
    notices.add({ level: "info", code: "one", text: "One again." });
    parts["log-open"].click();
    const logged = [...parts["log-list"].querySelectorAll("p > span")];
    expect(logged.map(({ textContent }) => textContent)).toEqual(["One again.", "Two."]);
  });
});
