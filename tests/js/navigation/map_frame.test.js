import { describe, expect, it } from "vitest";
import {
  corners,
  headingOf,
  onMap,
  panned,
  toPixels,
  toPoint,
  whole,
  zoomed,
} from "../../../static/js/navigation/map_frame.js";

const MAP = {
  origin_x_m: -2,
  origin_y_m: 1,
  origin_rad: 0,
  resolution_m: 0.05,
  width: 200,
  height: 100,
};
const SIZE = [400, 300];

describe("the part of the map that is seen", () => {
  it("holds the whole map, with north up", () => {
    const frame = whole(corners(MAP), ...SIZE);
    const [left, bottom] = toPixels(frame, [-2, 1], ...SIZE);
    const [right, top] = toPixels(frame, [8, 6], ...SIZE);
    expect(left).toBeGreaterThan(0);
    expect(right).toBeLessThan(400);
    expect(top).toBeGreaterThan(0);
    expect(bottom).toBeLessThan(300);
    expect(top).toBeLessThan(bottom);
  });

  it("leaves free what controls cover, but not more than two thirds", () => {
    const covered = { left: 150, right: 50, above: 20, below: 100 };
    const frame = whole(corners(MAP), ...SIZE, covered);
    const [left, bottom] = toPixels(frame, [-2, 1], ...SIZE);
    const [right, top] = toPixels(frame, [8, 6], ...SIZE);
    expect([left, right, top, bottom].map(Math.round)).toEqual([158, 342, 64, 156]);
    const small = whole(corners(MAP), ...SIZE, { ...covered, left: 300, right: 200 });
    expect(Math.round(10 * small.scale)).toBe(123); // 133 pixels less the margin, for 10 m
  });

  it("turns with the map’s origin", () => {
    const turned = corners({ ...MAP, origin_rad: Math.PI / 2 });
    expect(turned[1][0]).toBeCloseTo(-2);
    expect(turned[1][1]).toBeCloseTo(11);
  });

  it("finds the point of a pixel again", () => {
    const frame = { x: 3, y: 2, scale: 40 };
    const point = toPoint(frame, [17, 250], ...SIZE);
    const [x, y] = toPixels(frame, point, ...SIZE);
    expect([x, y].map(Math.round)).toEqual([17, 250]);
  });

  it("keeps the point under the fingers when it zooms, within limits", () => {
    const frame = { x: 3, y: 2, scale: 40 };
    const before = toPoint(frame, [50, 60], ...SIZE);
    const after = toPoint(zoomed(frame, 2, [50, 60], ...SIZE, 2), [50, 60], ...SIZE);
    expect(after[0]).toBeCloseTo(before[0]);
    expect(after[1]).toBeCloseTo(before[1]);
    expect(zoomed(frame, 1e9, [0, 0], ...SIZE, 2).scale).toBe(200);
    expect(zoomed(frame, 1e-9, [0, 0], ...SIZE, 2).scale).toBe(2);
  });

  it("is never smaller after a step outwards", () => {
    const hall = { ...MAP, width: 6000, height: 4000 }; // pixels: 300 m wide
    const frame = whole(corners(hall), ...SIZE);
    expect(frame.scale).toBeLessThan(2);
    expect(zoomed(frame, 1 / 1.5, [0, 0], ...SIZE, frame.scale).scale).toBe(frame.scale);
    expect(zoomed(frame, 1 / 1.5, [0, 0], ...SIZE, 2).scale).toBe(frame.scale);
  });

  it("moves with the finger", () => {
    const frame = { x: 3, y: 2, scale: 40 };
    const point = toPoint(frame, [100, 100], ...SIZE);
    const moved = toPixels(panned(frame, 30, -10), point, ...SIZE);
    expect(moved.map(Math.round)).toEqual([130, 90]);
  });
});

describe("a point that is chosen", () => {
  it("looks to where the finger was dragged, else as it did", () => {
    expect(headingOf([10, 10], [10, 60], 9)).toBeCloseTo(-Math.PI / 2);
    expect(headingOf([10, 10], [60, 10], 9)).toBeCloseTo(0);
    expect(headingOf([10, 10], [15, 10], 9)).toBe(9);
  });

  it("puts what the robot sees onto the map", () => {
    const [x, y] = onMap({ x: 1, y: 2, heading: Math.PI / 2 }, [100, 50]);
    expect(x).toBeCloseTo(0.5);
    expect(y).toBeCloseTo(3);
  });
});
