import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { parts } from "../../../static/js/lib/dom.js";
import { corners, toPixels, toPoint, whole } from "../../../static/js/navigation/map_frame.js";
import { MapPanel } from "../../../static/js/navigation/map_panel.js";
import { endNotice, goingText } from "../../../static/js/navigation/words.js";
import { pointerEvent } from "../hand/events.js";

const NAMES = [
  ...["map-none", "map-words", "places-none", "place-dialog-title", "place-refused"],
  ...["map-picked", "place-delete-title"],
];
const BUTTONS = [
  ...[
    "map-open",
    "map-go",
    "map-places",
    "map-pose",
    "map-place",
    "map-in",
    "map-out",
    "map-fit",
    "camera-swap",
  ],
  ...["place-add", "place-here", "map-name", "places-import", "place-delete"],
  ...["map-picked-go", "map-picked-close"],
];
const KITCHEN = { number: 7, name: "kitchen", x: 3, y: 1.5, heading: 0.5 };
const SIDES = {
  width: 100,
  height: 80,
  resolution_m: 0.1,
  origin_x_m: -2,
  origin_y_m: -2,
  origin_rad: 0,
};
const MAP = {
  map: "abc",
  name: "Office",
  robots: ["tiago-1"],
  earlier: [],
  changeable: true,
  ...SIDES,
};
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

function pointer(type, clientX, clientY, pointerId = 1) {
  return pointerEvent(type, { clientX, clientY, pointerId });
}

describe("the map over the picture", () => {
  let panel;
  let page;
  let request;
  let notify;
  let maps;
  let answers; // by method, instead of the maps
  let asked;

  beforeEach(() => {
    vi.stubGlobal(
      "ResizeObserver",
      class {
        observe() {}
        disconnect() {}
      },
    );
    vi.stubGlobal("requestAnimationFrame", () => 1);
    answers = {};
    asked = [];
    vi.stubGlobal("fetch", async (address, { method = "GET", body = null } = {}) => {
      asked.push([method, address, body && JSON.parse(body)]);
      const { status = 200, ...data } = answers[method] ?? { maps };
      return {
        ok: status < 300,
        status,
        headers: new Headers({ ETag: '"5"' }),
        json: async () => data,
      };
    });
    maps = [];
    vi.stubGlobal(
      "Image",
      class {
        async decode() {}
      },
    );
    HTMLDialogElement.prototype.show ??= function open() {
      this.open = true;
    };
    HTMLDialogElement.prototype.close ??= function close() {
      this.open = false;
    };
    HTMLCanvasElement.prototype.getContext = () => PEN;
    const root = document.createElement("div");
    root.innerHTML = `<section data-part="map" data-help="Map" hidden></section>
      <section data-part="places" hidden><h2 data-part="places-title"></h2><ul data-part="places-list"></ul>
      <ul data-part="places-earlier"></ul><div data-part="places-change"></div><a data-part="places-export"></a>
      <input type="file" data-part="places-file"></section>
      <dialog data-part="place-delete-dialog"><form></form></dialog>
      <dialog data-part="place-dialog"><form data-part="place-form"><input data-part="place-name"></form></dialog>${BUTTONS.map(
        (name) => `<button data-part="${name}"></button>`,
      ).join("")}${NAMES.map((name) => `<p data-part="${name}"></p>`).join("")}`;
    root.dataset.part = "picture-area";
    root.dataset.robot = "tiago-1";
    document.body.replaceChildren(root);
    page = parts(document);
    request = vi.fn(() => Promise.resolve(null));
    notify = vi.fn();
    panel = new MapPanel({ root, parts: page, request, notify, tell: () => {} });
    panel.facts = { has_map: true };
    panel.view = { state: { location: LOCATION }, scan: null };
  });

  afterEach(() => {
    panel.close();
    vi.restoreAllMocks();
    vi.unstubAllGlobals();
  });

  function opened() {
    page["map-open"].click();
    const canvas = page.map.querySelector("canvas");
    Object.defineProperties(canvas, { clientWidth: { value: 400 }, clientHeight: { value: 300 } });
    return canvas;
  }

  /** Open the panel with the robot's map, and wait for the map. */
  async function openedWithMap() {
    maps = [{ ...MAP, places: [] }];
    const canvas = opened();
    await vi.waitFor(() => expect(page["map-none"].hidden).toBe(true));
    await new Promise((resolve) => setTimeout(resolve));
    return canvas;
  }

  /** Return the place under a pixel of the whole map, rounded to millimetres. */
  function placeAt(...pixel) {
    const frame = whole(corners(MAP), 400, 300);
    const [x, y] = toPoint(frame, pixel, 400, 300).map(
      (metres) => Math.round(metres * 1000) / 1000,
    );
    return { x, y };
  }

  it("chooses no place before the map is there, and says why", () => {
    const canvas = opened();
    panel.mayAct = true;
    for (const part of ["map-go", "map-pose"]) {
      page[part].click();
      expect(page[part].getAttribute("aria-pressed")).toBe("false");
    }
    canvas.dispatchEvent(pointer("pointerdown", 240, 150));
    canvas.dispatchEvent(pointer("pointerup", 240, 110));
    expect(request).not.toHaveBeenCalled();
    expect(notify).toHaveBeenCalledWith(expect.objectContaining({ code: "map unknown" }));
  });

  it("takes no press without a drag for where the robot looks", async () => {
    const canvas = await openedWithMap();
    panel.mayAct = true;
    page["map-pose"].click();
    canvas.dispatchEvent(pointer("pointerdown", 240, 150));
    canvas.dispatchEvent(pointer("pointerup", 240, 150));
    expect(request).not.toHaveBeenCalled();
    expect(page["map-words"].textContent).toContain("Press, then drag");
    expect(page["map-pose"].getAttribute("aria-pressed")).toBe("true");
  });

  it("chooses no place any more after Escape", async () => {
    const canvas = await openedWithMap();
    panel.mayAct = true;
    page["map-go"].click();
    const pressed = () =>
      Object.assign(new Event("keydown", { bubbles: true, cancelable: true }), { key: "Escape" });
    const first = pressed();
    canvas.dispatchEvent(first);
    expect(first.defaultPrevented).toBe(true);
    expect(page["map-go"].getAttribute("aria-pressed")).toBe("false");
    canvas.dispatchEvent(pointer("pointerdown", 240, 150));
    canvas.dispatchEvent(pointer("pointerup", 240, 150));
    expect(request).not.toHaveBeenCalled();
    const second = pressed(); // another part of the page may use this press to close
    canvas.dispatchEvent(second);
    expect(second.defaultPrevented).toBe(false);
  });

  /** Press the button of the offer; not at once, because it ignores the second tap of a double tap. */
  function takeOffer() {
    vi.spyOn(performance, "now").mockReturnValue(performance.now() + 600);
    page["map-picked-go"].click();
  }

  it("shows a ghost by a press and a drag, and sends the robot there by a button", async () => {
    const canvas = await openedWithMap();
    panel.mayAct = true;
    page["map-go"].click();
    canvas.dispatchEvent(pointer("pointerdown", 240, 150));
    canvas.dispatchEvent(pointer("pointermove", 240, 110));
    canvas.dispatchEvent(pointer("pointerup", 240, 110));
    expect(request).not.toHaveBeenCalled();
    expect(page["map-picked-go"].textContent).toBe("Go here");
    takeOffer();
    expect(request).toHaveBeenCalledWith({
      t: "go",
      ...placeAt(240, 150),
      heading: 1.571,
      map: "abc",
    });
    expect(page["map-go"].getAttribute("aria-pressed")).toBe("false");
    expect(page["map-picked"].hidden).toBe(true);
  });

  it("shows a ghost by a plain press, which a drag turns and another press removes", async () => {
    const canvas = await openedWithMap();
    panel.mayAct = true;
    pressed(canvas, 240, 150);
    expect(page["map-picked-go"].textContent).toBe("Go here");
    expect(page["map-words"].textContent).toContain("Drag it");
    pressed(canvas, 240, 150);
    expect(page["map-picked"].hidden).toBe(true);
    pressed(canvas, 240, 150);
    canvas.dispatchEvent(pointer("pointerdown", 245, 150));
    canvas.dispatchEvent(pointer("pointermove", 240, 200));
    canvas.dispatchEvent(pointer("pointerup", 240, 200));
    takeOffer();
    const goal = { t: "go", ...placeAt(240, 150), heading: -1.571, map: "abc" };
    expect(request).toHaveBeenCalledExactlyOnceWith(goal);
    pressed(canvas, 240, 150);
    panel.mayAct = false; // the world is silent for a moment
    takeOffer();
    expect(page["map-picked"].hidden).toBe(false);
    expect(page["map-picked-go"].getAttribute("aria-disabled")).toBe("true");
    expect(request).toHaveBeenCalledTimes(1);
  });

  it("keeps the choice of a place while the world is silent, and ends it with control", async () => {
    const canvas = await openedWithMap();
    panel.mayAct = true;
    panel.fence = 7;
    page["map-pose"].click();
    panel.mayAct = false;
    canvas.dispatchEvent(new KeyboardEvent("keydown", { key: ",", bubbles: true }));
    canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter", bubbles: true }));
    expect(page["map-pose"].getAttribute("aria-pressed")).toBe("true");
    expect(request).not.toHaveBeenCalled();
    panel.fence = null;
    expect(page["map-pose"].getAttribute("aria-pressed")).toBe("false");
  });

  it("tells the robot where it is, by keys too, and lets no arrow drive it there", async () => {
    const canvas = await openedWithMap();
    panel.mayAct = true;
    page["map-pose"].click();
    const reached = vi.fn();
    document.body.addEventListener("keydown", reached);
    for (const key of ["ArrowRight", ",", "Enter"])
      canvas.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
    expect(request).toHaveBeenCalledWith({
      t: "set_pose",
      ...placeAt(260, 150), // an arrow moves the map by 60 pixels
      heading: 0.262,
      map: "abc",
    });
    expect(reached).not.toHaveBeenCalled();
    canvas.dispatchEvent(new KeyboardEvent("keydown", { key: " ", bubbles: true }));
    expect(reached).toHaveBeenCalledTimes(1); // the map never holds back the space key, which stops
  });

  it("tells a robot that knows no place of itself where it is, and says that it is needed", async () => {
    const state = { phase: "online", location: null, going: null };
    panel.view = { state, scan: { laser_cm: [100, 0] } };
    expect(page["map-open"].hidden).toBe(false);
    const canvas = await openedWithMap();
    panel.view = { state, scan: null };
    expect(page["map-words"].hidden).toBe(true); // without control the page does not know this
    panel.mayAct = true;
    panel.view = { state, scan: null };
    expect(page["map-words"].textContent).toContain("does not know where it is");
    page["map-pose"].click();
    expect(page["map-words"].textContent).toContain("Press where the robot is");
    canvas.dispatchEvent(pointer("pointerdown", 240, 150));
    canvas.dispatchEvent(pointer("pointermove", 240, 110));
    canvas.dispatchEvent(pointer("pointerup", 240, 110));
    const pose = { ...placeAt(240, 150), heading: 1.571, map: "abc" };
    expect(request).toHaveBeenCalledExactlyOnceWith({ t: "set_pose", ...pose });
    panel.view = { state: { ...state, location: LOCATION }, scan: null };
    expect(page["map-words"].hidden).toBe(true);
  });

  it("has a button only where there is a map, and closes one that has gone", () => {
    panel.facts = {};
    expect(page["map-open"].hidden).toBe(true);
    panel.facts = { has_map: true };
    opened();
    panel.facts = { has_map: false };
    expect(page.map.hidden).toBe(true);
    panel.view = { state: { location: LOCATION }, scan: null };
    expect(page["map-open"].hidden).toBe(true);
  });

  it("does not send a goal that a second finger interrupts", () => {
    const canvas = opened();
    panel.mayAct = true;
    page["map-go"].click();
    canvas.dispatchEvent(pointer("pointerdown", 240, 150));
    canvas.dispatchEvent(pointer("pointerdown", 100, 100, 2));
    canvas.dispatchEvent(pointer("pointermove", 300, 150));
    canvas.dispatchEvent(pointer("pointerup", 300, 150));
    canvas.dispatchEvent(pointer("pointerup", 100, 100, 2));
    expect(request).not.toHaveBeenCalled();
  });

  it("asks for control first", () => {
    opened();
    page["map-go"].click();
    expect(notify).toHaveBeenCalledWith(expect.objectContaining({ text: "Take control first." }));
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
    panel.going = { now: null, ended: null };
    panel.going = { now: null, ended: END };
    expect(notify).toHaveBeenCalledWith(
      expect.objectContaining({ level: "success", text: "The robot is there." }),
    );
    panel.going = { now: null, ended: END };
    expect(notify).toHaveBeenCalledTimes(1);
  });

  it("says that no map is known yet, without an error in the console", async () => {
    opened();
    await vi.waitFor(() => expect(page["map-none"].textContent).toContain("No map of this robot"));
    expect(asked).toEqual([["GET", "/api/v1/maps?robot=tiago-1", null]]);
    answers.GET = { status: 503, detail: "Not now." };
    page["map-open"].click();
    page["map-open"].click();
    await vi.waitFor(() => expect(page["map-none"].textContent).toBe("Not now."));
  });

  async function openedWith(...known) {
    maps = known;
    const canvas = opened();
    await vi.waitFor(() => expect(page["places-list"].children.length).toBeGreaterThan(0));
    page["map-places"].click();
    return canvas;
  }

  function rowButtons() {
    return [...page["places-list"].querySelectorAll("button")];
  }

  it("sends the robot to a place of the list, in control only", async () => {
    await openedWith({ ...MAP, places: [KITCHEN] });
    const [kitchen] = rowButtons();
    expect(page["places-title"].textContent).toContain("Office");
    kitchen.click();
    expect(notify).toHaveBeenCalledWith(expect.objectContaining({ text: "Take control first." }));
    panel.mayAct = true;
    kitchen.click();
    expect(request).toHaveBeenCalledExactlyOnceWith({
      t: "go",
      x: 3,
      y: 1.5,
      heading: 0.5,
      place: "kitchen",
    });
    expect(page.places.hidden).toBe(true);
  });

  function pressed(canvas, x, y, slip = 0) {
    canvas.dispatchEvent(pointer("pointerdown", x, y));
    canvas.dispatchEvent(pointer("pointermove", x + slip, y));
    canvas.dispatchEvent(pointer("pointerup", x + slip, y));
    canvas.dispatchEvent(pointer("click", x + slip, y));
  }

  it("offers to drive to a place that is pressed on the map, and sends no robot before", async () => {
    const canvas = await openedWith({ ...MAP, places: [KITCHEN] });
    const [x, y] = toPixels(whole(corners(MAP), 400, 300), [KITCHEN.x, KITCHEN.y], 400, 300);
    const clock = vi.spyOn(performance, "now").mockReturnValue(1000);
    panel.mayAct = true;
    for (const _ of ["shows a ghost", "removes it"]) pressed(canvas, x - 60, y);
    canvas.dispatchEvent(pointer("pointerdown", x, y));
    canvas.dispatchEvent(pointer("pointerup", x, y)); // a click follows, and must not press the offer
    expect(page["map-picked"].hidden).toBe(true);
    pressed(canvas, x, y + 10, 5);
    expect(page["map-picked-go"].textContent).toBe("Go to “kitchen”");
    page["map-picked-go"].click(); // the second tap of a double tap
    expect(request).not.toHaveBeenCalled();
    clock.mockReturnValue(1600);
    page["map-picked-go"].click();
    const goal = { t: "go", x: 3, y: 1.5, heading: 0.5, place: "kitchen" };
    expect(request).toHaveBeenCalledExactlyOnceWith(goal);
    expect(page["map-picked"].hidden).toBe(true);
    pressed(canvas, x, y);
    pressed(canvas, x - 60, y); // beside the place
    expect(page["map-picked-go"].textContent).toBe("Go here");
    pressed(canvas, x - 60, y);
    pressed(canvas, x, y, 30); // this press moves the map
    expect(page["map-picked"].hidden).toBe(true);
  });

  it("says why it does not drive to a pressed place without control", async () => {
    const canvas = await openedWith({ ...MAP, places: [KITCHEN] });
    panel.mayAct = false;
    pressed(canvas, ...toPixels(whole(corners(MAP), 400, 300), [KITCHEN.x, KITCHEN.y], 400, 300));
    expect(page["map-picked-go"].title).toBe("Take control first.");
    vi.spyOn(performance, "now").mockReturnValue(performance.now() + 600);
    page["map-picked-go"].click();
    expect(notify).toHaveBeenCalledWith(expect.objectContaining({ text: "Take control first." }));
    expect(request).not.toHaveBeenCalled();
    expect(page["map-picked"].hidden).toBe(false);
  });

  it("keeps the focus at its place when the list changes, for letters drive the robot", async () => {
    await openedWith({ ...MAP, places: [KITCHEN] });
    const office = { ...KITCHEN, number: 8, name: "office" };
    maps = [{ ...MAP, places: [office, { ...KITCHEN, name: "Kitchen" }] }];
    for (const _ of ["closes", "opens, and reads the maps"]) page["map-open"].click();
    rowButtons()[1].focus();
    await vi.waitFor(() => expect(rowButtons()).toHaveLength(4));
    expect(document.activeElement).toBe(rowButtons()[3]);
  });

  it("adds a place that is pressed on the map, without control, and says why one is refused", async () => {
    const canvas = await openedWith({ ...MAP, places: [KITCHEN] });
    page["place-add"].click();
    expect(page.map.dataset.chooses).toBe("place");
    canvas.dispatchEvent(pointer("pointerdown", 240, 150));
    canvas.dispatchEvent(pointer("pointermove", 240, 110));
    canvas.dispatchEvent(pointer("pointerup", 240, 110));
    expect(request).not.toHaveBeenCalled();
    answers.POST = { status: 409, detail: "The name is taken." };
    page["place-name"].value = " lab ";
    page["place-form"].dispatchEvent(new Event("submit", { cancelable: true }));
    await vi.waitFor(() => expect(page["place-refused"].textContent).toBe("The name is taken."));
    expect(page["place-dialog"].open).toBe(true);
    answers.POST = { status: 201 };
    page["place-form"].dispatchEvent(new Event("submit", { cancelable: true }));
    await vi.waitFor(() => expect(page["place-dialog"].open).toBe(false));
    const [method, address, body] = asked.findLast(([how]) => how === "POST");
    expect([method, address]).toEqual(["POST", "/api/v1/maps/abc/places"]);
    expect(body).toMatchObject({ name: "lab", heading: 1.571 });
  });

  it("changes no place that somebody else changed meanwhile", async () => {
    await openedWith({ ...MAP, places: [KITCHEN] });
    rowButtons()[1].click();
    expect(page["place-name"].value).toBe("kitchen");
    answers.GET = { ...KITCHEN, x: 4 };
    page["place-form"].dispatchEvent(new Event("submit", { cancelable: true }));
    await vi.waitFor(() =>
      expect(page["place-refused"].textContent).toContain("changed meanwhile"),
    );
    answers.GET = KITCHEN;
    answers.PATCH = KITCHEN;
    page["place-form"].dispatchEvent(new Event("submit", { cancelable: true }));
    await vi.waitFor(() => expect(page["place-dialog"].open).toBe(false));
    answers.DELETE = { status: 204 };
    rowButtons()[1].click();
    page["place-delete"].click();
    expect(page["place-delete-title"].textContent).toBe("Delete the place “kitchen”?");
    expect(page["place-dialog"].open).toBe(false);
    await Promise.resolve();
    expect(asked.some(([method]) => method === "DELETE")).toBe(false);
    page["map-name"].click(); // another dialog does not change this question
    page["place-delete-dialog"].querySelector("form").dispatchEvent(new Event("submit"));
    await vi.waitFor(() =>
      expect(notify).toHaveBeenCalledWith(
        expect.objectContaining({ text: "The place “kitchen” was deleted." }),
      ),
    );
  });

  it("takes no place of an earlier map over, and says so", async () => {
    maps = [
      { ...MAP, places: [], changeable: false },
      { ...MAP, map: "old", robots: [], earlier: ["tiago-1"], places: [KITCHEN] },
    ];
    opened();
    await vi.waitFor(() => expect(page["places-none"].textContent).toContain("This map is new"));
    expect(page["places-list"].children.length).toBe(0);
    expect(page["places-earlier"].textContent).toBe("Office, 1 place");
    expect(page["places-change"].hidden).toBe(true);
  });
});

describe("words", () => {
  it("pass on why a drive ended", () => {
    const failed = { outcome: "failed", text: "Navigation said: no plan." };
    expect(endNotice(failed).text).toContain("no plan");
    expect(endNotice({ outcome: "replaced", text: "" }).text).toContain("stick");
    expect(goingText({ left_m: 2.44, since_s: 5.2 })).toBe(
      "Drives to a place: 2.4 m left, 5 s on the way",
    );
    expect(goingText({ left_m: 2.44, since_s: 5.2, place: "kitchen" })).toBe(
      "Drives to “kitchen”: 2.4 m left, 5 s on the way",
    );
    expect(goingText({ left_m: null, since_s: 3, ending: "" })).toBe(
      "Drives to a place: 3 s on the way",
    );
    expect(goingText({ left_m: 1, since_s: 3, ending: "because" })).toContain("ended");
  });
});
