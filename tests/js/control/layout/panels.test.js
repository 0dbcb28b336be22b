import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Choices } from "../../../../static/js/control/choices.js";
import { moved, Panels } from "../../../../static/js/control/layout/panels.js";

const NAMES = ["chart", "motions", "phrases"];
const BOXES = { chart: [0, 100], motions: [100, 200], phrases: [200, 300] }; // from left to right

describe("the panels of a desk", () => {
  let root;
  let panels;
  let messages;
  const panel = (name) => root.querySelector(`[data-panel="${name}"]`);
  const handle = (name) => root.querySelector(`[data-moves="${name}"]`);
  const places = () => NAMES.map((name) => panel(name).dataset.place);
  const press = (name, key) => {
    const event = new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true });
    handle(name).dispatchEvent(event);
  };
  const pointer = (name, type, clientX) =>
    handle(name).dispatchEvent(Object.assign(new Event(type), { clientX, clientY: 5 }));
  const open = (person) => {
    messages = [];
    panels = new Panels(root, new Choices({ person }), (text) => messages.push(text));
  };

  beforeEach(() => {
    vi.stubGlobal("fetch", () => Promise.reject(new Error("offline"))); // the browser's copy is enough
    document.body.innerHTML = `<main>${NAMES.map(
      (name) => `<section data-panel="${name}"><button data-moves="${name}"></button></section>`,
    ).join("")}</main>`;
    root = document.querySelector("main");
    for (const name of NAMES) {
      const [left, right] = BOXES[name];
      panel(name).getBoundingClientRect = () => ({ left, right, top: 0, bottom: 10 });
    }
    open("ann");
  });
  afterEach(() => panels.close());

  it("exchange places", () => {
    const before = { chart: "left", motions: "top", phrases: "bottom" };
    expect(moved(before, "motions", "left")).toEqual({
      chart: "top",
      motions: "left",
      phrases: "bottom",
    });
  });

  it("move back", () => {
    press("motions", "ArrowLeft");
    panels.reset();
    panels.close();
    open("ann");
    expect(places()).toEqual(["left", "top", "bottom"]);
  });

  it("move by arrow keys, which do not drive", () => {
    const drives = vi.fn();
    window.addEventListener("keydown", drives);
    press("motions", "ArrowLeft");
    expect(places()).toEqual(["top", "left", "bottom"]);
    press("motions", "ArrowLeft"); // no place is further to the left
    expect(places()).toEqual(["top", "left", "bottom"]);
    press("motions", "ArrowRight");
    expect(places()).toEqual(["left", "top", "bottom"]);
    expect(messages).toEqual(["above the stick", "beside the picture, above"]);
    expect(drives).not.toHaveBeenCalled();
    window.removeEventListener("keydown", drives);
  });

  it("move where they are dropped, and stay there for their person", () => {
    pointer("phrases", "pointerdown", 210);
    pointer("phrases", "pointermove", 10);
    expect(panel("chart").dataset.target).toBe("true");
    pointer("phrases", "pointerup", 10);
    expect(places()).toEqual(["bottom", "top", "left"]);
    panels.close();
    open("bo");
    expect(places()).toEqual(["left", "top", "bottom"]);
    panels.close();
    open("ann");
    expect(places()).toEqual(["bottom", "top", "left"]);
  });
});
