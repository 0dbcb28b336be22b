import { describe, expect, it } from "vitest";
import {
  arc,
  carried,
  poseAfter,
  reach,
  spanFor,
} from "../../../static/js/drive/twist_geometry.js";

describe("the path of a constant twist", () => {
  it("is a line without turning", () => {
    expect(poseAfter({ vx: 0.5, vy: 0, w: 0 }, 2)).toEqual({ x: 1, y: 0, yaw: 0 });
  });

  it("is a quarter circle after a quarter turn", () => {
    const radius = 0.8;
    const pose = poseAfter({ vx: radius * 0.5, vy: 0, w: 0.5 }, Math.PI);
    expect(pose.x).toBeCloseTo(radius);
    expect(pose.y).toBeCloseTo(radius);
    expect(pose.yaw).toBeCloseTo(Math.PI / 2);
  });

  it("bends the same way forwards and backwards in time", () => {
    const twist = { vx: 0.4, vy: 0.1, w: -0.7 };
    const there = poseAfter(twist, 1.3);
    const back = poseAfter({ vx: -0.4, vy: -0.1, w: 0.7 }, 1.3);
    const [[x, y]] = carried([[back.x, back.y]], there);
    expect(x).toBeCloseTo(0);
    expect(y).toBeCloseTo(0);
  });

  it("hardly differs between almost straight and straight", () => {
    const straight = poseAfter({ vx: 1, vy: 0, w: 0 }, 2);
    const almost = poseAfter({ vx: 1, vy: 0, w: 2e-4 }, 2);
    expect(almost.x).toBeCloseTo(straight.x, 5);
    expect(almost.y).toBeCloseTo(0, 3);
  });

  it("stays on the spot when only turning", () => {
    const { x, y } = poseAfter({ vx: 0, vy: 0, w: 1 }, 2);
    expect([x, y]).toEqual([0, 0]);
  });

  it("ends where the time ends", () => {
    const twist = { vx: 0.3, vy: 0, w: 0.4 };
    const poses = arc(twist, 2, 8);
    expect(poses).toHaveLength(8);
    expect(poses.at(-1)).toEqual(poseAfter(twist, 2));
  });
});

describe("an outline", () => {
  it("is turned and moved with the pose", () => {
    const [[x, y]] = carried([[1, 0]], { x: 2, y: 3, yaw: Math.PI / 2 });
    expect(x).toBeCloseTo(2);
    expect(y).toBeCloseTo(4);
  });

  it("reaches as far as its farthest corner", () => {
    expect(reach([[3, 4], [0, 1]])).toBe(5); // biome-ignore format: one line
  });
});

describe("the span of the picture", () => {
  const ring = (metres, count) => Array.from({ length: count }, () => [metres * 100, 0]).flat();

  it("fits most of what is seen", () => {
    expect(spanFor(ring(1.5, 50), 6.5)).toBe(2);
    expect(spanFor(ring(4, 50), 2)).toBe(4.5);
  });

  it("does not pump when the scan is on the edge between two", () => {
    const edge = [...ring(1.5, 68), ...ring(2.5, 32)];
    expect(spanFor(edge, 2)).toBe(2);
    expect(spanFor(edge, 3)).toBe(3);
  });

  it("stays as it is when nothing is seen", () => {
    expect(spanFor([], 4.5)).toBe(4.5);
  });
});
