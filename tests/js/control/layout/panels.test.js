import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import {
  moved,
  orderOf,
  Panels,
  STANDARD_ORDER,
} from "../../../../static/js/control/layout/panels.js";

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

  beforeEach(() => {
    document.body.innerHTML = `<main>${NAMES.map(
      (name) => `<section data-panel="${name}"><button data-moves="${name}"></button></section>`,
    ).join("")}</main>`;
    root = document.querySelector("main");
    for (const name of NAMES) {
      const [left, right] = BOXES[name];
      panel(name).getBoundingClientRect = () => ({ left, right, top: 0, bottom: 10 });
    }
    messages = [];
    panels = new Panels(root, ({ text }) => messages.push(text));
    panels.order = STANDARD_ORDER;
    panels.addEventListener("move", ({ detail }) => Object.assign(panels, { order: detail }));
  });
  afterEach(() => panels.close());

  it("exchange places", () => {
    expect(moved(STANDARD_ORDER, "motions", 0)).toEqual(["motions", "chart", "phrases"]);
  });

  it("are found where they were kept by name", () => {
    const kept = { chart: "top", motions: "left", phrases: "bottom" };
    expect(orderOf(kept)).toEqual(["motions", "chart", "phrases"]);
    expect(orderOf({ ...kept, chart: "left" })).toEqual(STANDARD_ORDER);
    expect(orderOf({})).toEqual(STANDARD_ORDER);
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

  it("move where they are dropped", () => {
    pointer("phrases", "pointerdown", 210);
    pointer("phrases", "pointermove", 10);
    expect(panel("chart").dataset.target).toBe("true");
    pointer("phrases", "pointerup", 10);
    expect(places()).toEqual(["bottom", "top", "left"]);
  });
});
