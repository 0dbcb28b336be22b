import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { parts } from "../../../static/js/lib/dom.js";
import { MapPanel } from "../../../static/js/navigation/map_panel.js";
import { endText, goingText } from "../../../static/js/navigation/words.js";

const NAMES = ["map-none", "map-words"];
const BUTTONS = ["map-open", "map-go", "map-pose", "map-in", "map-out", "map-fit"];
const LOCATION = {
  x: 1,
  y: 2,
  heading: 0,
  sigma_m: 0.1,
  sigma_across_m: 0.1,
  ellipse_rad: 0,
  sigma_rad: 0.1,
  problem: "",
};
const END = { fence: 1, seq: 7, outcome: "arrived", text: "" };
const PEN = new Proxy({}, { get: () => () => {}, set: () => true });

function pointer(type, x, y, pointerId = 1) {
  return Object.assign(new Event(type, { bubbles: true }), { clientX: x, clientY: y, pointerId });
}

describe("the map over the picture", () => {
  let panel;
  let page;
  let order;
  let tell;

  beforeEach(() => {
    vi.stubGlobal(
      "ResizeObserver",
      class {
        observe() {}
        disconnect() {}
      },
    );
    vi.stubGlobal("requestAnimationFrame", () => 1);
    vi.stubGlobal("fetch", () =>
      Promise.resolve({ ok: false, json: async () => ({ detail: "no map is known" }) }),
    );
    HTMLCanvasElement.prototype.getContext = () => PEN;
    const root = document.createElement("div");
    root.innerHTML = `<section data-part="map" data-help="Map" hidden></section>${BUTTONS.map(
      (name) => `<button data-part="${name}"></button>`,
    ).join("")}${NAMES.map((name) => `<p data-part="${name}"></p>`).join("")}`;
    document.body.replaceChildren(root);
    page = parts(root);
    order = vi.fn(() => Promise.resolve(null));
    tell = vi.fn();
    panel = new MapPanel(root, page, "/map", { order, tell });
    panel.view = { state: { location: LOCATION, going: null, going_ended: null }, scan: null };
  });

  afterEach(() => {
    panel.close();
    vi.unstubAllGlobals();
  });

  function opened() {
    page["map-open"].click();
    const canvas = page.map.querySelector("canvas");
    Object.defineProperties(canvas, { clientWidth: { value: 400 }, clientHeight: { value: 300 } });
    return canvas;
  }

  it("sends the robot to a place by a press and a drag", () => {
    const canvas = opened();
    panel.drives = true;
    page["map-go"].click();
    canvas.dispatchEvent(pointer("pointerdown", 240, 150));
    canvas.dispatchEvent(pointer("pointermove", 240, 110));
    canvas.dispatchEvent(pointer("pointerup", 240, 110));
    expect(order).toHaveBeenCalledWith({ t: "go", x: 2, y: 2, heading: 1.571 });
    expect(page["map-go"].getAttribute("aria-pressed")).toBe("false");
    canvas.dispatchEvent(pointer("pointerdown", 240, 150));
    canvas.dispatchEvent(pointer("pointerup", 240, 150));
    expect(order).toHaveBeenCalledTimes(1); // a press without a mode only moves the map
  });

  it("tells the robot where it is, by keys too, and lets no arrow drive it there", () => {
    const canvas = opened();
    panel.drives = true;
    page["map-pose"].click();
    const reached = vi.fn();
    document.body.addEventListener("keydown", reached);
    for (const key of ["ArrowRight", ",", "Enter"])
      canvas.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
    expect(order).toHaveBeenCalledWith({ t: "set_pose", x: 2.5, y: 2, heading: 0.262 });
    expect(reached).not.toHaveBeenCalled();
    canvas.dispatchEvent(new KeyboardEvent("keydown", { key: " ", bubbles: true }));
    expect(reached).toHaveBeenCalledTimes(1); // the stop is never kept
  });

  it("does not send a goal that a second finger interrupts", () => {
    const canvas = opened();
    panel.drives = true;
    page["map-go"].click();
    canvas.dispatchEvent(pointer("pointerdown", 240, 150));
    canvas.dispatchEvent(pointer("pointerdown", 100, 100, 2));
    canvas.dispatchEvent(pointer("pointermove", 300, 150));
    canvas.dispatchEvent(pointer("pointerup", 300, 150));
    canvas.dispatchEvent(pointer("pointerup", 100, 100, 2));
    expect(order).not.toHaveBeenCalled();
  });

  it("asks for control first", () => {
    opened();
    page["map-go"].click();
    expect(tell).toHaveBeenCalledWith(expect.objectContaining({ text: "Take control first." }));
    expect(page["map-go"].getAttribute("aria-pressed")).toBe("false");
  });

  it("says why the robot cannot be sent, and that its base is held", () => {
    opened();
    const state = { location: { ...LOCATION, problem: "It is lost." }, going: null };
    panel.view = { state, scan: null };
    expect(page["map-words"].textContent).toBe("It is lost.");
    panel.view = { state: { ...state, navigation_held: "It drives on." }, scan: null };
    expect(page["map-words"].textContent).toBe("It drives on.");
  });

  it("says how a drive ended, and nothing of one that ended before", () => {
    const state = { location: LOCATION, going: null };
    panel.view = { state: { ...state, going_ended: END }, scan: null };
    expect(tell).toHaveBeenCalledWith(
      expect.objectContaining({ level: "success", text: "The robot is there." }),
    );
    panel.view = { state: { ...state, going_ended: END }, scan: null };
    expect(tell).toHaveBeenCalledTimes(1);
  });

  it("says why there is no map", async () => {
    opened();
    await vi.waitFor(() => expect(page["map-none"].textContent).toBe("no map is known"));
  });
});

describe("words", () => {
  it("pass on why a drive ended", () => {
    expect(endText({ outcome: "failed", text: "Navigation said: no plan." })).toContain("no plan");
    expect(endText({ outcome: "replaced", text: "" })).toContain("stick");
    expect(goingText({ left_m: 2.44, since_s: 5.2 })).toBe("Drives to a place: 2.4 m left, 5 s");
    expect(goingText({ left_m: null, since_s: 3, ending: "" })).toBe("Drives to a place: 3 s");
    expect(goingText({ left_m: 1, since_s: 3, ending: "because" })).toContain("ended");
  });
});
