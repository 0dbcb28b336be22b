import { beforeEach, describe, expect, it } from "vitest";
import { NEUTRAL, Stick } from "../../../../static/js/drive/input/stick.js";

const FORWARD = { x: 1, y: 0, w: 0 };
const LEFT = { x: 0, y: 0, w: 1 };

describe("the stick", () => {
  let stick;
  let zeros;

  beforeEach(() => {
    stick = new Stick();
    zeros = [];
    stick.addEventListener("zero", ({ detail }) => zeros.push(detail));
  });

  it("follows the one input that moves", () => {
    stick.feed("joystick", FORWARD);
    expect(stick.axes).toEqual(FORWARD);
    expect(stick.input).toBe("joystick");
  });

  it("is free again once its input rests", () => {
    stick.feed("joystick", FORWARD);
    stick.feed("joystick", NEUTRAL);
    expect(stick.axes).toEqual(NEUTRAL);
    stick.feed("keyboard", LEFT);
    expect(stick.input).toBe("keyboard");
  });

  it("ignores resting inputs while another drives", () => {
    stick.feed("joystick", FORWARD);
    stick.feed("gamepad", NEUTRAL);
    expect(stick.axes).toEqual(FORWARD);
    expect(zeros).toEqual([]);
  });

  it("goes to zero at once when a second input moves", () => {
    stick.feed("joystick", FORWARD);
    stick.feed("keyboard", LEFT);
    expect(stick.axes).toEqual(NEUTRAL);
    expect(zeros).toEqual([{ reason: "input-changed", input: "joystick" }]);
  });

  it("obeys neither of two colliding inputs until each has rested", () => {
    stick.feed("joystick", FORWARD);
    stick.feed("keyboard", LEFT);
    stick.feed("joystick", FORWARD);
    stick.feed("keyboard", LEFT);
    expect(stick.axes).toEqual(NEUTRAL);
    expect(stick.waitsForNeutral).toBe(true);
    stick.feed("keyboard", NEUTRAL);
    stick.feed("keyboard", LEFT);
    expect(stick.axes).toEqual(LEFT);
    expect(stick.waitsForNeutral).toBe(true); // the joystick is still held
    stick.feed("joystick", NEUTRAL);
    expect(stick.waitsForNeutral).toBe(false);
  });

  it("ignores an input after a forced zero until it rests", () => {
    stick.feed("joystick", FORWARD);
    stick.neutralise("hidden");
    stick.feed("joystick", FORWARD);
    expect(stick.axes).toEqual(NEUTRAL);
    stick.feed("joystick", NEUTRAL);
    stick.feed("joystick", FORWARD);
    expect(stick.axes).toEqual(FORWARD);
  });

  it("ends nothing when nothing drives", () => {
    stick.neutralise("blurred");
    expect(zeros).toEqual([]);
    stick.feed("joystick", FORWARD);
    expect(stick.axes).toEqual(FORWARD);
  });
});
