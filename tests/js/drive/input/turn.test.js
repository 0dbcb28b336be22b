import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { NEUTRAL, Stick } from "../../../../static/js/drive/input/stick.js";
import { reverseIsBlind, TurnAndLook } from "../../../../static/js/drive/input/turn.js";
import { point } from "../../hand/events.js";

const BLIND = {
  code: "blind_direction",
  way: "reverse",
  text: "at most 0.1 m/s in reverse",
  mps: 0.1,
};
const LEFT = { x: 0, y: 0, w: 1 };

const happen = (button, type, timeStamp, facts = {}) =>
  point(button, type, { timeStamp, ...facts });

describe("the Turn button", () => {
  let button;
  let stick;
  let hint;
  let turn;

  beforeEach(() => {
    button = document.body.appendChild(document.createElement("button"));
    button.hidden = true;
    stick = new Stick();
    hint = vi.fn();
    turn = new TurnAndLook(button, stick, hint);
    turn.mayAct = true;
  });

  afterEach(() => {
    turn.close();
    button.remove();
  });

  it("is shown while sensors do not see all behind the robot", () => {
    turn.state = { verdict: { limits: [] } };
    expect(button.hidden).toBe(true);
    turn.state = { verdict: { limits: [BLIND] } };
    expect(button.hidden).toBe(false);
    expect(reverseIsBlind({ limits: [{ ...BLIND, way: "left" }] })).toBe(false);
    expect(reverseIsBlind({})).toBe(false);
  });

  it("is offered from a refused pull on until something has looked", () => {
    const limits = [{ ...BLIND, code: "behind_unseen" }];
    turn.state = { verdict: { limits, asked: [0.3, 0, 0] } };
    expect(button.hidden).toBe(false);
    expect(button.dataset.offered).toBeUndefined();
    for (const asked of [-0.1, 0]) {
      turn.state = { verdict: { limits, asked: [asked, 0, 0] } };
      expect(button.dataset.offered).toBeDefined();
    }
    turn.state = { verdict: { limits: [BLIND], asked: [-0.1, 0, 0] } };
    expect(button.dataset.offered).toBeUndefined();
  });

  it("says how far to turn while it is held", () => {
    const unseen = { verdict: { limits: [{ ...BLIND, code: "behind_unseen" }] } };
    turn.state = unseen;
    expect(turn.holdText).toBe("");
    happen(button, "pointerdown", 0);
    expect(turn.holdText).toBe("Hold until reverse is allowed: about half a turn.");
    turn.state = { verdict: { limits: [BLIND] } };
    expect(turn.holdText).toBe("Reverse is allowed now: let go.");
    happen(button, "pointerup", 2000);
    expect(turn.holdText).toBe("");
    happen(button, "pointerdown", 3000); // nothing is refused now
    expect(turn.holdText).toBe("");
  });

  it("turns as long as a finger holds it", () => {
    happen(button, "pointerdown", 0);
    expect(stick.axes).toEqual(LEFT);
    happen(button, "pointerup", 2000);
    expect(stick.axes).toEqual(NEUTRAL);
    expect(hint).not.toHaveBeenCalled();
  });

  it.each(["pointercancel", "lostpointercapture"])("ends with %s", (type) => {
    happen(button, "pointerdown", 0);
    happen(button, type, 1000);
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("ignores a press that a program made: there is no pointer to capture", () => {
    button.setPointerCapture = () => {
      throw new DOMException("no such pointer", "NotFoundError");
    };
    happen(button, "pointerdown", 0);
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("ends when keys go elsewhere", () => {
    happen(button, "keydown", 0, { code: "Enter" });
    button.dispatchEvent(new Event("blur"));
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("ignores the other mouse buttons", () => {
    happen(button, "pointerdown", 0, { button: 2, buttons: 2 });
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("turns while Enter is held, and leaves Space to the stop", () => {
    happen(button, "keydown", 0, { code: "Space" });
    expect(stick.axes).toEqual(NEUTRAL);
    expect(happen(button, "keydown", 0, { code: "Enter" }).defaultPrevented).toBe(true);
    happen(button, "keydown", 500, { code: "Enter", repeat: true });
    expect(stick.axes).toEqual(LEFT);
    happen(button, "keyup", 1000, { code: "Enter" });
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("says after a tap that it must be held", () => {
    happen(button, "pointerdown", 0);
    happen(button, "pointerup", 100);
    expect(hint).toHaveBeenCalledWith(true);
  });

  it("turns nothing without control, and says so", () => {
    turn.mayAct = false;
    expect(button.getAttribute("aria-disabled")).toBe("true");
    happen(button, "pointerdown", 0);
    expect(stick.axes).toEqual(NEUTRAL);
    happen(button, "pointerup", 1000);
    expect(hint).toHaveBeenCalledWith(false);
  });

  it("ends with control, and stays under the finger", () => {
    turn.state = { verdict: { limits: [BLIND] } };
    happen(button, "pointerdown", 0);
    turn.state = { verdict: { limits: [] } };
    expect(button.hidden).toBe(false);
    turn.mayAct = false;
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("waits for the finger to lift after a stop", () => {
    happen(button, "pointerdown", 0);
    stick.neutralise("stop");
    expect(stick.axes).toEqual(NEUTRAL);
    happen(button, "pointerup", 1000);
    happen(button, "pointerdown", 2000);
    expect(stick.axes).toEqual(LEFT);
  });
});
