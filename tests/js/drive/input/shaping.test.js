import { describe, expect, it } from "vitest";
import {
  curve,
  fromGamepad,
  fromJoystick,
  fullAtRim,
  withoutDeadZone,
} from "../../../../static/js/drive/input/shaping.js";
import { NEUTRAL } from "../../../../static/js/drive/input/stick.js";

describe("the dead zone", () => {
  it("ignores small values and still reaches full", () => {
    expect(withoutDeadZone(0.07, 0.08)).toBe(0);
    expect(withoutDeadZone(-0.08, 0.08)).toBe(0);
    expect(withoutDeadZone(1, 0.08)).toBe(1);
    expect(withoutDeadZone(-1, 0.15)).toBe(-1);
  });

  it("begins without a jump", () => {
    expect(withoutDeadZone(0.081, 0.08)).toBeCloseTo(0.001, 2);
  });

  it("limits to the range, and turns NaN into zero", () => {
    expect(withoutDeadZone(1.4, 0.1)).toBe(1);
    expect(withoutDeadZone(Number.NaN, 0.1)).toBe(0);
  });
});

describe("the curve", () => {
  it("is odd, gentle in the middle and full at the rim", () => {
    expect(curve(0.2)).toBeLessThan(0.2);
    expect(curve(-0.2)).toBe(-curve(0.2));
    expect(curve(1)).toBe(1);
  });
});

describe("the rim", () => {
  const rim = Array.from({ length: 72 }, (_, step) => (step * Math.PI) / 36);

  it("is full in every direction", () => {
    for (const angle of rim) {
      const [x, y] = fullAtRim(Math.cos(angle), Math.sin(angle));
      expect(Math.max(Math.abs(x), Math.abs(y))).toBeCloseTo(1, 12);
    }
  });

  it("keeps the direction, and small positions small", () => {
    for (const angle of rim) {
      const [x, y] = fullAtRim(0.2 * Math.cos(angle), 0.2 * Math.sin(angle));
      expect(Math.cos(Math.atan2(y, x) - angle)).toBeCloseTo(1, 12);
      expect(Math.max(Math.abs(x), Math.abs(y))).toBeCloseTo(0.2, 12);
    }
  });

  it("changes nothing along the axes and in the middle", () => {
    expect(fullAtRim(0, 0)).toEqual([0, 0]);
    expect(fullAtRim(0, -0.5)).toEqual([0, -0.5]);
    expect(fullAtRim(0.5, 0)).toEqual([0.5, 0]);
  });
});

describe("the joystick", () => {
  const DIAGONAL = { right: -Math.SQRT1_2, up: Math.SQRT1_2 };

  it("drives a bend as fast as keys do", () => {
    expect(fromJoystick(DIAGONAL, false)).toEqual({ x: 1, y: 0, w: 1 });
  });

  it("slides as fast in every direction", () => {
    const { x, y } = fromJoystick(DIAGONAL, true);
    expect(x).toBe(y);
    expect(x).toBeLessThan(0.8);
  });

  it("turns left or slides left, as sideways means", () => {
    expect(fromJoystick({ right: -1, up: 0 }, false)).toEqual({ x: 0, y: 0, w: 1 });
    expect(fromJoystick({ right: -1, up: 0 }, true)).toEqual({ x: 0, y: 1, w: 0 });
  });

  it("drives straight with the thumb slightly off the line", () => {
    expect(fromJoystick({ right: 0.07, up: 0.9 }, false).w).toBe(0);
  });

  it("rests in the middle, without negative zeros", () => {
    expect(fromJoystick({ right: 0.01, up: -0.02 }, false)).toBe(NEUTRAL);
    expect(Object.is(fromJoystick({ right: 0, up: 1 }, false).w, 0)).toBe(true);
  });
});

describe("the gamepad", () => {
  it("turns with either stick on a base that cannot slide", () => {
    expect(fromGamepad([0, -1, 0, 0], false)).toEqual({ x: 1, y: 0, w: 0 });
    expect(fromGamepad([1, 0, 0, 0], false)).toEqual({ x: 0, y: 0, w: -1 });
    expect(fromGamepad([0, 0, -1, 0], false)).toEqual({ x: 0, y: 0, w: 1 });
  });

  it("slides with the left stick if the base can", () => {
    expect(fromGamepad([-1, 0, 0, 0], true)).toEqual({ x: 0, y: 1, w: 0 });
    expect(fromGamepad([-0.7, -0.7, 0, 0], true).x).toBeLessThan(0.8);
  });

  it("drives a bend as fast as keys, also beyond a round rim", () => {
    expect(fromGamepad([-0.71, -0.71, 0, 0], false)).toEqual({ x: 1, y: 0, w: 1 });
    expect(fromGamepad([0.85, -0.85, 0, 0], false)).toEqual({ x: 1, y: 0, w: -1 });
  });

  it("rests within a worn stick's drift", () => {
    expect(fromGamepad([0.12, -0.1, 0.14, 0], true)).toEqual({ x: 0, y: 0, w: 0 });
  });
});
