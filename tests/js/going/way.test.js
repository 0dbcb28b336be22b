import { describe, expect, it } from "vitest";
import { fromBase, onFloor, wayTo } from "../../../static/js/going/way.js";
import { problemText, wayText } from "../../../static/js/going/words.js";

const SQUARE = [
  [0.3, 0.2],
  [-0.3, 0.2],
  [-0.3, -0.2],
  [0.3, -0.2],
];
const MARGINS = { front_margin_m: 0.1, lateral_margin_m: 0 };
const way = (point, flatCm = []) => wayTo(point, SQUARE, flatCm, MARGINS);

describe("a short way", () => {
  it("is a turn on the spot, then straight on, and the ghost looks to where it came", () => {
    const { turnRad, distanceM, problem, ghost, nose } = way([0, 2]);
    expect(turnRad).toBeCloseTo(Math.PI / 2);
    expect([distanceM, problem]).toEqual([2, ""]);
    expect(ghost[0]).toEqual([expect.closeTo(-0.2), expect.closeTo(2.3)]); // the front left corner
    expect(nose).toEqual([expect.closeTo(0), expect.closeTo(2.24)]);
  });

  it("has no turn to what is ahead", () => {
    expect(way([2, 0.02]).turnRad).toBe(0);
    expect(way([2, -0.2]).turnRad).toBeLessThan(0);
  });

  it.each([
    ["is 3 m long at most", [3.1, 0], [], "far", "Too far: at most 3.0 m"],
    ["ends before what is known on it", [2, 0], [150, 0], "blocked", "Blocked after 1.1 m"],
    [
      "is checked where it goes, after the turn",
      [0, -2],
      [0, -150],
      "blocked",
      "Blocked after 1.1 m",
    ],
    ["needs room to turn", [0, 2], [0, 32], "turn", "No room to turn"],
    ["passes what is beside it", [2, 0], [100, 30, -100, 0], "", ""],
  ])("%s", (_, point, flatCm, problem, text) => {
    const found = way(point, flatCm);
    expect(found.problem).toBe(problem);
    expect(problemText(found)).toBe(text);
    expect(wayText(found)).toBe(text || "2.0 m away");
  });

  it("stays at its place while the robot moves", () => {
    const place = onFloor([1, 1], { x: 5, y: 3, yaw: Math.PI / 2 });
    expect(place).toEqual([expect.closeTo(4), expect.closeTo(4)]);
    expect(fromBase(place, { x: 4, y: 3, yaw: Math.PI })).toEqual([
      expect.closeTo(0),
      expect.closeTo(-1),
    ]);
  });
});
