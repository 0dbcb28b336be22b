import { describe, expect, it } from "vitest";
import { inUnits } from "../../../static/js/reports/bars.js";
import { lastAt, placeAt } from "../../../static/js/reports/replay.js";

const DRIVES = [
  [
    [10, 0, 0, 0],
    [14, 40, 20, -90],
  ],
  [
    [20, 40, 20, -90],
    [21, 50, 20, -90],
  ],
];

describe("the place of the robot at a moment", () => {
  it("is evenly between two samples", () => {
    expect(placeAt(DRIVES, 11)).toEqual({ x: 10, y: 5, degrees: -22.5, moving: true });
  });

  it("is where the last drive ended, until the next begins", () => {
    const place = { x: 40, y: 20, degrees: -90 };
    expect(placeAt(DRIVES, 14)).toEqual({ ...place, moving: false });
    expect(placeAt(DRIVES, 19.9)).toEqual({ ...place, moving: false });
    expect(placeAt(DRIVES, 20)).toEqual({ ...place, moving: true });
  });

  it("is the first start before, and the last end after drives", () => {
    expect(placeAt(DRIVES, 0)).toEqual({ x: 0, y: 0, degrees: 0, moving: false });
    expect(placeAt(DRIVES, 100)).toEqual({ x: 50, y: 20, degrees: -90, moving: false });
  });

  it("does not exist without a drive", () => {
    expect(placeAt([], 5)).toBeNull();
  });
});

describe("the last entry at a moment", () => {
  it("is the last one that is not later", () => {
    const times = [0, 2, 2, 5];
    expect([-1, 0, 2, 4.9, 9].map((time) => lastAt(times, time))).toEqual([-1, 0, 2, 2, 3]);
  });
});

describe("the unit of bars", () => {
  it("is minutes as long as none of them is an hour", () => {
    expect(inUnits([0.5, 0]).values).toEqual([30, 0]);
    expect(inUnits([1, 0.5]).values).toEqual([1, 0.5]);
  });
});
