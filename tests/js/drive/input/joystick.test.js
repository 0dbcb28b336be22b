import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Joystick } from "../../../../static/js/drive/input/joystick.js";
import { NEUTRAL, Stick } from "../../../../static/js/drive/input/stick.js";
import { WITHOUT_HAND_MS } from "../../../../static/js/hand/proof.js";
import { point } from "../../hand/events.js";

const SIZE = 200;

/** Make a zone of 200 by 200 pixels at the page's corner, because happy-dom computes no layout. */
function makeZone() {
  const zone = document.body.appendChild(document.createElement("div"));
  zone.getBoundingClientRect = () => ({ left: 0, top: 0, width: SIZE, height: SIZE });
  return zone;
}

describe("the joystick", () => {
  let zone;
  let stick;
  let joystick;

  const push = (facts = {}) => {
    point(zone, "pointerdown", { clientX: 100, clientY: 100, ...facts });
    point(window, "pointermove", { clientX: 100, clientY: 0, ...facts });
  };
  const lift = () => point(window, "pointerup", { clientX: 100, clientY: 0 });
  const knob = () => {
    const { style } = zone.querySelector(".knob");
    return ["--right", "--down"].map((name) => Number(style.getPropertyValue(name)));
  };

  beforeEach(() => {
    vi.useFakeTimers();
    vi.stubGlobal(
      "ResizeObserver",
      class {
        observe() {}
        disconnect() {}
      },
    );
    zone = makeZone();
    stick = new Stick();
    joystick = new Joystick(zone, stick);
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

  it("shows where a finger and keys hold the stick, within the rim", () => {
    push({ clientX: 100 });
    expect(knob()).toEqual([0, -1]);
    lift();
    expect(knob()).toEqual([0, 0]);
    stick.feed("keyboard", { x: 1, y: 0, w: 1 });
    expect(knob()).toEqual([expect.closeTo(-Math.SQRT1_2), expect.closeTo(-Math.SQRT1_2)]);
    stick.feed("keyboard", NEUTRAL);
    expect(knob()).toEqual([0, 0]);
    expect(stick.axes).toEqual(NEUTRAL); // the moving knob drives nothing
  });

  it("follows only the main button", () => {
    push({ button: 2, buttons: 2 });
    expect(stick.axes).toEqual(NEUTRAL);
    push({ ctrlKey: true }); // a right click on a Mac
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("ends when an event says that no button is down any more", () => {
    push();
    point(window, "pointermove", { clientX: 100, clientY: 10, buttons: 0 });
    expect(stick.axes).toEqual(NEUTRAL);
    push();
    expect(stick.axes.x).toBe(1);
  });

  it("ends with a second button, until the first is released", () => {
    push();
    point(window, "pointermove", { clientX: 100, clientY: 10, button: 2, buttons: 3 });
    point(window, "pointermove", { clientX: 100, clientY: 0 });
    expect([stick.axes, stick.waitsForNeutral]).toEqual([NEUTRAL, true]);
    lift();
    push();
    expect(stick.axes.x).toBe(1);
  });

  it("takes another finger if the page never heard the first one lift", () => {
    push({ pointerId: 7 });
    push({ pointerId: 8 }); // a second finger while the first holds
    expect(stick.axes.x).toBe(1);
    vi.advanceTimersByTime(4_200);
    expect(stick.axes).toEqual(NEUTRAL);
    push({ pointerId: 9 });
    expect(stick.axes.x).toBe(1);
  });

  it("goes to the middle if a finger sends nothing for 4 s", () => {
    push();
    vi.advanceTimersByTime(3_800);
    expect(stick.axes.x).toBe(1);
    point(window, "pointermove", { clientX: 100, clientY: 1 });
    vi.advanceTimersByTime(3_800);
    expect(stick.axes.x).toBe(1);
    point(window, "pointermove", { clientX: 100, clientY: 1 }); // nothing new: it proves nothing
    vi.advanceTimersByTime(400);
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it.each(["pointercancel", "lostpointercapture"])("does not stick after %s", (type) => {
    joystick.sticky = true;
    push();
    point(zone, type, { clientX: 100, clientY: 0 });
    expect([stick.axes, joystick.sticks]).toEqual([NEUTRAL, false]);
  });

  it("does not stick if the finger lifted while the page stood still", () => {
    joystick.sticky = true;
    push();
    vi.setSystemTime(Date.now() + 3_000);
    lift();
    expect([stick.axes, joystick.sticks]).toEqual([NEUTRAL, false]);
  });

  it("keeps a sticky position for 30 seconds", () => {
    joystick.sticky = true;
    push();
    lift();
    expect(joystick.sticks).toBe(true);
    vi.advanceTimersByTime(WITHOUT_HAND_MS - 200);
    expect(stick.axes.x).toBe(1);
    vi.advanceTimersByTime(300);
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
    point(window, "pointermove", { clientX: 100, clientY: 10 });
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
