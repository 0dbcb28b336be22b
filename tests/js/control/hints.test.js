import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Choices } from "../../../static/js/control/choices.js";
import { Hints } from "../../../static/js/control/hints.js";

const NAMES = ["first-steps", "hint-count", "hint-text", "hint-next", "hint-close", "hints-open"];

describe("the hints of a first visit", () => {
  let root;
  let parts;
  const open = (person) => {
    root = document.createElement("main");
    parts = Object.fromEntries(NAMES.map((name) => [name, document.createElement("button")]));
    parts["first-steps"].hidden = true;
    const hints = new Hints(root, parts, new Choices({ person }));
    hints.begin();
    return hints;
  };
  let person = 0;
  beforeEach(() => {
    person += 1;
    vi.useFakeTimers();
    vi.stubGlobal("fetch", () => Promise.reject(new Error("offline"))); // the browser's copy is enough
  });
  afterEach(() => vi.useRealTimers());

  it("go on with each thing that is done, and end for good", () => {
    const hints = open(person);
    expect(root.dataset.hint).toBe("take");
    hints.done("stop"); // too early: the first hint is still shown
    expect(parts["hint-count"].textContent).toBe("1 of 3");
    for (const step of ["take", "stick", "stop"]) hints.done(step);
    expect(parts["first-steps"].hidden).toBe(true);
    open(person);
    expect(parts["first-steps"].hidden).toBe(true);
  });

  it("can be dismissed, and called again from the menu", () => {
    open(person);
    parts["hint-close"].click();
    open(person);
    expect(root.dataset.hint).toBeUndefined();
    parts["hints-open"].click();
    expect(root.dataset.hint).toBe("take");
    parts["hint-next"].click();
    expect(root.dataset.hint).toBe("stick");
  });

  it("wait for what they hint at, however long that takes", () => {
    open(person);
    vi.advanceTimersByTime(3_600_000);
    expect(root.dataset.hint).toBe("take");
  });

  it("are new to each person", () => {
    open(person);
    parts["hint-close"].click();
    open(`${person} and another`);
    expect(parts["first-steps"].hidden).toBe(false);
  });
});
