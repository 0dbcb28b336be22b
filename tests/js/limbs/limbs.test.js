import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { parts } from "../../../static/js/lib/dom.js";
import { HeadStick, shaped } from "../../../static/js/limbs/head_stick.js";
import { LimbPanel } from "../../../static/js/limbs/limb_panel.js";
import { endNotice, movingText } from "../../../static/js/limbs/words.js";
import { point, type } from "../hand/events.js";

const RANGES = { gripper: { least_m: 0, most_m: 0.09 }, torso: { least_m: 0, most_m: 0.35 } };
const BUTTONS = [
  "robot-open",
  "head-open",
  "arm-home",
  "gripper-open",
  "gripper-close",
  "look-ahead",
];
const PAGE = `${BUTTONS.map((name) => `<button data-part="${name}"></button>`).join("")}
  <div data-part="gripper-row"><output data-part="gripper-at"></output><input type="range" data-part="gripper-to"></div>
  <div data-part="torso-row"><output data-part="torso-at"></output><input type="range" data-part="torso-to"></div>
  <div data-part="head-box" hidden><button data-part="head-ahead"></button>
  <div data-part="head-pad"><span data-part="head-knob"></span></div></div>`;
const END = { fence: 1, seq: 7, outcome: "no_progress", text: "", at_m: 0.02 };

let page;
let request;

beforeEach(() => {
  vi.useFakeTimers();
  document.body.innerHTML = PAGE;
  page = parts(document.body);
  request = vi.fn(() => Promise.resolve(null));
});

afterEach(() => vi.useRealTimers());

describe("the drawer of arm, gripper and torso", () => {
  let panel;
  let notify;

  beforeEach(() => {
    notify = vi.fn();
    panel = new LimbPanel({ parts: page, request, notify });
    panel.facts = { limbs: RANGES, has_head: true };
    panel.mayAct = true;
  });

  afterEach(() => panel.close());

  it("opens and closes the gripper", () => {
    page["gripper-open"].click();
    page["gripper-close"].click();
    expect(request.mock.calls.map(([{ to_m }]) => to_m)).toEqual([0.09, 0]);
  });

  it("sends one bounded goal when a slider is let go", () => {
    const slider = page["torso-to"];
    point(slider, "pointerdown");
    for (const value of [0.1, 0.2, 0.25]) {
      slider.value = value;
      slider.dispatchEvent(new Event("input"));
    }
    expect(request).not.toHaveBeenCalled();
    point(slider, "pointerup");
    slider.dispatchEvent(new Event("change"));
    expect(request.mock.calls).toEqual([
      [{ t: "move_limb", limb: "torso", to_m: 0.25, quiet: true }],
    ]);
  });

  it("passes on a slider without control as well: the refusal says why", async () => {
    panel.mayAct = false;
    const slider = page["torso-to"];
    expect([slider.disabled, slider.title]).toEqual([false, "Take control first."]);
    panel.limbs = { torso: { at_m: 0.1 } };
    request.mockResolvedValueOnce({ code: "no_lease" });
    point(slider, "pointerdown");
    slider.value = 0.2;
    slider.dispatchEvent(new Event("input"));
    point(slider, "pointerup");
    slider.dispatchEvent(new Event("change"));
    expect(request).toHaveBeenCalledOnce();
    await vi.waitFor(() =>
      expect([slider.value, page["torso-at"].textContent]).toEqual(["0.1", "10 cm"]),
    );
    panel.mayAct = true;
    expect(slider.title).toBe("");
  });

  it("leaves a limb where it is if the page is left while its slider is held", () => {
    panel.limbs = { torso: { at_m: 0.1 } };
    const slider = page["torso-to"];
    slider.dispatchEvent(Object.assign(new Event("pointerdown"), { button: 0 }));
    slider.value = 0.2;
    slider.dispatchEvent(new Event("input"));
    window.dispatchEvent(new Event("blur"));
    expect(slider.value).toBe("0.1");
    slider.dispatchEvent(new Event("change")); // the browser ends the drag
    vi.advanceTimersByTime(1000);
    expect(request).not.toHaveBeenCalled();
  });

  const lost = [
    ["bare mouse", () => point(window, "pointermove", { buttons: 0 })],
    ["second button", () => point(window, "pointermove", { buttons: 3 })],
    ["menu", () => page["torso-to"].dispatchEvent(new Event("contextmenu", { bubbles: true }))],
    ["a finger that scrolls", () => point(window, "pointercancel")],
    ["a window that opens", () => page["torso-to"].dispatchEvent(new Event("change"))], // in Chromium
    ["Cmd", () => type(window, "keydown", "MetaLeft", { key: "Meta" })],
    [
      "a page that stood still until the finger lifted",
      () => {
        vi.setSystemTime(Date.now() + 3_000);
        point(window, "pointerup");
      },
    ],
  ];

  it.each(lost)("leaves a limb where it is if its slider loses the hand: %s", (_, lose) => {
    panel.limbs = { torso: { at_m: 0.1 } };
    const slider = page["torso-to"];
    point(slider, "pointerdown");
    slider.dispatchEvent(new Event("focusin", { bubbles: true }));
    const slide = (value) => {
      slider.value = value;
      slider.dispatchEvent(new Event("input"));
    };
    slide(0.2);
    point(window, "pointermove", { clientX: 5 });
    lose();
    expect(slider.value).toBe("0.1");
    type(slider, "keydown", "Escape");
    slide(0.3); // the pointer wanders
    slider.dispatchEvent(new Event("change")); // a click elsewhere
    vi.advanceTimersByTime(1000);
    expect([request.mock.calls, slider.value]).toEqual([[], "0.1"]);
    point(slider, "pointerdown");
    slide(0.2);
    point(slider, "pointermove", { pointerId: 2, buttons: 0 }); // a mouse beside the finger
    point(slider, "pointerup");
    slider.dispatchEvent(new Event("change"));
    expect(request).toHaveBeenCalledOnce();
  });

  it("waits for a finger that rests on a slider", () => {
    const slider = page["torso-to"];
    point(slider, "pointerdown");
    vi.advanceTimersByTime(60_000);
    slider.value = 0.2;
    point(slider, "pointerup");
    slider.dispatchEvent(new Event("change"));
    expect(request).toHaveBeenCalledOnce();
  });

  it("waits until arrow keys rest", () => {
    const slider = page["gripper-to"];
    for (const value of [0.01, 0.02, 0.03]) {
      slider.value = value;
      slider.dispatchEvent(new Event("input"));
      slider.dispatchEvent(new Event("change"));
      vi.advanceTimersByTime(100);
    }
    expect(request).not.toHaveBeenCalled();
    vi.advanceTimersByTime(400);
    expect(request).toHaveBeenCalledOnce();
    expect(request.mock.calls[0][0].to_m).toBe(0.03);
  });

  it("shows where limbs are, but not under a finger", () => {
    panel.limbs = { gripper: { at_m: 0.04 }, torso: { at_m: 0.15 } };
    expect(page["torso-at"].textContent).toBe("15 cm");
    expect(page["gripper-to"].value).toBe("0.04");
    page["torso-to"].dispatchEvent(Object.assign(new Event("pointerdown"), { button: 0 }));
    panel.limbs = { gripper: { at_m: 0.05 }, torso: { at_m: 0.3 } };
    expect(page["torso-at"].textContent).toBe("15 cm");
  });

  it("offers the way home only if the robot has that motion", () => {
    panel.offers = { motions: [{ name: "wave" }] };
    expect(page["arm-home"].hidden).toBe(true);
    panel.offers = { motions: [{ name: "home", title: "Home" }] };
    page["arm-home"].click();
    expect(request).toHaveBeenCalledWith({ t: "play", motion: "home", title: "Home" });
  });

  it("hides what the robot has not", () => {
    panel.facts = { limbs: {}, has_head: false };
    expect(page["robot-open"].hidden && page["head-open"].hidden).toBe(true);
    expect(page["torso-row"].hidden).toBe(true);
  });

  it("tells an end that nobody wished, once, and none from before the page", () => {
    panel.limbs = { gripper: { at_m: 0.02, ended: END } };
    expect(notify).not.toHaveBeenCalled();
    const later = { ...END, seq: 8 };
    panel.limbs = { gripper: { at_m: 0.02, ended: later } };
    panel.limbs = { gripper: { at_m: 0.02, ended: later } };
    expect(notify).toHaveBeenCalledOnce();
    expect(notify.mock.calls[0][0].text).toBe("Gripper: stopped on its way. It is at 2.0 cm.");
    expect(notify.mock.calls[0][0].level).toBe("info"); // no warning: the gripper may hold an object
  });
});

describe("the head's stick", () => {
  let stick;
  let notify;
  const press = (type, clientX = 0, clientY = 0) =>
    point(page["head-pad"], type, { clientX, clientY });

  beforeEach(() => {
    page["head-pad"].getBoundingClientRect = () => ({ left: 0, top: 0, width: 100, height: 100 });
    notify = vi.fn();
    stick = new HeadStick({ parts: page, request, notify, steers: () => true });
    stick.facts = { has_head: true };
    stick.mayAct = true;
  });

  afterEach(() => stick.close());

  it("says once in each control that the head turned by itself", () => {
    const eachState = () => {
      for (const follows of [true, true, true]) stick.head_follows = follows;
    };
    eachState();
    expect(notify.mock.calls.map(([{ code }]) => code)).toEqual(["head follows"]);
    stick.mayAct = false;
    stick.fence = null;
    eachState(); // of another person
    expect(notify).toHaveBeenCalledTimes(1);
    stick.mayAct = true;
    eachState();
    expect(notify).toHaveBeenCalledTimes(2);
  });

  it("turns the head while it is held, and not a moment longer", async () => {
    press("pointerdown", 0, 50);
    await vi.advanceTimersByTimeAsync(450);
    const count = request.mock.calls.length;
    expect(count).toBe(4);
    expect(request.mock.calls[0][0].pan).toBeCloseTo(0.135);
    press("pointerup");
    await vi.advanceTimersByTimeAsync(1000);
    expect(request.mock.calls.length).toBe(count);
  });

  it("goes by keys, and ends when the window loses them", async () => {
    const key = (type, code) => window.dispatchEvent(Object.assign(new Event(type), { code }));
    key("keydown", "KeyI");
    await vi.advanceTimersByTimeAsync(300);
    const count = request.mock.calls.length;
    expect(request.mock.calls[0][0].tilt).toBeGreaterThan(0);
    window.dispatchEvent(new Event("blur"));
    await vi.advanceTimersByTimeAsync(500);
    expect(request.mock.calls.length).toBe(count);
    const dialog = document.body.appendChild(document.createElement("dialog"));
    dialog.show();
    key("keydown", "KeyO");
    expect(request.mock.calls.length).toBe(count);
    dialog.remove();
    key("keydown", "KeyO");
    expect(request).toHaveBeenLastCalledWith({ t: "look_ahead" });
  });

  it("waits for a new press of a key that is held when input ends, and for a robot with a head", async () => {
    const key = (type, code, repeat = false) =>
      window.dispatchEvent(Object.assign(new Event(type, { cancelable: true }), { code, repeat }));
    key("keydown", "KeyJ");
    stick.mayAct = false; // a stop, or the end of control
    stick.mayAct = true;
    request.mockClear();
    key("keydown", "KeyJ", true);
    await vi.advanceTimersByTimeAsync(300);
    expect(request).not.toHaveBeenCalled();
    stick.facts = { has_head: false };
    for (const code of ["KeyJ", "KeyO"]) key("keydown", code);
    await vi.advanceTimersByTimeAsync(300);
    expect(request).not.toHaveBeenCalled();
  });

  it("sends no more than two requests without an answer", async () => {
    request.mockImplementation(() => new Promise(() => {}));
    press("pointerdown", 50, 0);
    await vi.advanceTimersByTimeAsync(2000);
    expect(request.mock.calls.length).toBe(2);
  });

  it("ends at a refusal and without control", async () => {
    request.mockImplementation(() => Promise.resolve({ code: "stopped" }));
    press("pointerdown", 50, 0);
    await vi.advanceTimersByTimeAsync(1000);
    expect(request.mock.calls.length).toBe(1);
    stick.mayAct = false;
    press("pointerdown", 50, 0);
    await vi.advanceTimersByTimeAsync(1000);
    expect(request.mock.calls.length).toBe(1);
  });

  it("has a button that looks ahead; without control it looks disabled, and is still sent", () => {
    const button = page["look-ahead"];
    for (const may of [true, false]) {
      stick.mayAct = may;
      expect(button.getAttribute("aria-disabled")).toBe(may ? null : "true");
      button.click();
      expect(request).toHaveBeenLastCalledWith({ t: "look_ahead" });
    }
    expect([request.mock.calls.length, button.hidden]).toEqual([2, false]);
    stick.facts = { has_head: false };
    expect(button.hidden).toBe(true);
  });

  it("rests in the middle", () => {
    expect([shaped(0.1), shaped(1), shaped(-1)]).toEqual([0, 1, -1]);
    expect(shaped(0.5)).toBeLessThan(0.3);
  });
});

describe("words", () => {
  it("says which limb goes where", () => {
    const limbs = { gripper: { at_m: 0.04, to_m: 0.09 }, torso: { at_m: 0.15 } };
    expect(movingText(limbs)).toBe("Gripper: 4.0 cm, to 9.0 cm");
    expect(movingText({})).toBe("");
  });

  it("is silent about what a person wished", () => {
    expect(endNotice("torso", { ...END, outcome: "done" })).toBeNull();
    expect(endNotice("torso", { ...END, outcome: "arm_away" }).level).toBe("warning");
  });
});
