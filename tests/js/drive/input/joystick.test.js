import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Joystick, STICKY_MS } from "../../../../static/js/drive/input/joystick.js";
import { NEUTRAL, Stick } from "../../../../static/js/drive/input/stick.js";

const SIZE = 200;
let resized;

/** Make a zone of 200 by 200 pixels at the page's corner, because happy-dom computes no layout. */
function makeZone() {
  const zone = document.body.appendChild(document.createElement("div"));
  zone.style.position = "relative";
  Object.defineProperty(zone, "clientWidth", { get: () => SIZE });
  Object.defineProperty(zone, "clientHeight", { get: () => SIZE });
  return zone;
}

function pointer(target, type, pageX, pageY) {
  const event = new Event(type, { bubbles: true, cancelable: true });
  target.dispatchEvent(Object.assign(event, { pointerId: 5, pageX, pageY, pressure: 0.5 }));
}

describe("the joystick", () => {
  let zone;
  let stick;
  let joystick;

  const push = () => {
    pointer(zone, "pointerdown", 0, 0);
    pointer(document, "pointermove", 0, -SIZE);
  };
  const lift = () => pointer(document, "pointerup", 0, -SIZE);

  beforeEach(() => {
    vi.useFakeTimers();
    vi.stubGlobal(
      "ResizeObserver",
      class {
        constructor(act) {
          resized ??= act;
        }
        observe() {}
        disconnect() {}
      },
    );
    resized = null;
    zone = makeZone();
    stick = new Stick();
    joystick = new Joystick(zone, stick);
    resized();
  });

  afterEach(() => {
    joystick.close();
    document.body.replaceChildren();
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  it("drives while a finger pushes it, and rests when it lifts", () => {
    push();
    expect(stick.axes).toMatchObject({ x: 1, w: 0 });
    lift();
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("shows where keys hold the stick", () => {
    const knob = zone.querySelector(".front");
    stick.feed("keyboard", { x: 1, y: 0, w: 0 });
    expect(knob.style.transform).toBe("translate(0px, -72px)");
    stick.feed("keyboard", { x: 1, y: 0, w: 1 });
    expect(knob.style.transform).toMatch(/^translate\(-50\.9\d*px, -50\.9\d*px\)$/); // the knob stays within the rim
    stick.feed("keyboard", NEUTRAL);
    expect(knob.style.transform).toBe("translate(0px, 0px)");
    expect(stick.axes).toEqual(NEUTRAL); // the moving knob drives nothing
  });

  it("keeps a sticky position for 30 seconds", () => {
    joystick.sticky = true;
    push();
    lift();
    expect(joystick.sticks).toBe(true);
    vi.advanceTimersByTime(STICKY_MS - 10);
    expect(stick.axes.x).toBe(1);
    vi.advanceTimersByTime(20);
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("releases a sticky position when another input moves", () => {
    joystick.sticky = true;
    push();
    lift();
    stick.feed("keyboard", { x: 0, y: 0, w: 1 });
    expect(stick.axes).toEqual(NEUTRAL);
    expect(joystick.sticks).toBe(false);
    push();
    expect(stick.axes.x).toBe(1);
  });

  it("ignores a finger that was down before a forced zero", () => {
    push();
    stick.neutralise("stopped");
    pointer(document, "pointermove", 0, -SIZE);
    expect(stick.axes).toEqual(NEUTRAL);
    lift();
    push();
    expect(stick.axes.x).toBe(1);
  });

  it("returns to zero when sideways changes its meaning", () => {
    push();
    joystick.slides = true;
    expect(stick.axes).toEqual(NEUTRAL);
  });
});
