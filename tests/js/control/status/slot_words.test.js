import { describe, expect, test } from "vitest";
import {
  controlWords,
  isSlotFar,
  slotWarning,
  slotWords,
} from "../../../../static/js/control/status/control_words.js";

const anna = { name: "Anna", mine: false, seconds: 1200 };
const mine = { name: "You", mine: true, seconds: 320 };

describe("the slot line", () => {
  test("names the person who has the slot and counts down", () => {
    expect(slotWords({ booked: anna, next_booked: null }, 5)).toBe("Anna has a slot, 19:55 left");
  });

  test("says when the next slot begins, if that is soon", () => {
    expect(slotWords({ booked: null, next_booked: anna }, 0)).toBe(
      "The slot of Anna begins in 20:00",
    );
    expect(slotWords({ booked: null, next_booked: { ...anna, seconds: 20000 } }, 0)).toBe("");
  });
});

test("the slot line gives way on a small screen while the next slot is far", () => {
  const later = { ...anna, seconds: 3700 };
  expect(isSlotFar({ booked: null, next_booked: later }, 0)).toBe(true);
  expect(isSlotFar({ booked: null, next_booked: later }, 200)).toBe(false);
  expect(isSlotFar({ booked: mine, next_booked: later }, 0)).toBe(false);
  expect(isSlotFar({ booked: null, next_booked: null }, 0)).toBe(false);
});

describe("the warning to the holder", () => {
  const yours = { state: "yours", booked: null, next_booked: { ...anna, seconds: 310 } };

  test("comes 5 minutes and 1 minute before another slot begins", () => {
    expect(slotWarning(yours, 0)).toBe(null);
    expect(slotWarning(yours, 11).atS).toBe(300);
    expect(slotWarning(yours, 255).atS).toBe(60);
    expect(slotWarning(yours, 320)).toBe(null);
  });

  test("comes before one's own slot ends", () => {
    expect(slotWarning({ state: "yours", booked: mine, next_booked: null }, 30).text).toBe(
      "Your slot ends in 5 min: control ends with it.",
    );
  });

  test("comes before the robot is out of service, if that is first", () => {
    const out = { ...yours, booked: mine, out_s: 70 };
    expect(slotWarning(out, 11).atS).toBe(60);
    expect(slotWarning(out, 11).text).toBe(
      "The robot is out of service in 1 min: control ends then.",
    );
    expect(slotWarning(out, 11).ending).not.toBe(slotWarning(yours, 11).ending);
    expect(slotWarning({ ...out, out_s: 400 }, 30).text).toMatch(/^Your slot ends/);
  });

  test("is for the holder only", () => {
    expect(slotWarning({ ...yours, state: "other" }, 11)).toBe(null);
  });
});

test("a booked robot that nobody drives offers a supervisor to take over", () => {
  const control = { state: "free", refusal: { text: "Anna has booked it." }, may_take_over: true };
  expect(controlWords(control).actions).toEqual(["take_over"]);
});
