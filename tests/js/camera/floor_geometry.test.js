import { describe, expect, it } from "vitest";
import {
  edgeHints,
  floorAt,
  floorPath,
  inPicture,
} from "../../../static/js/camera/floor_geometry.js";
import { withArm } from "../../../static/js/drive/twist_geometry.js";

const SQUARE = [
  [0.3, 0.2],
  [-0.3, 0.2],
  [-0.3, -0.2],
  [0.3, -0.2],
];
// A camera 1 m above the base's centre that looks straight ahead: x_cam = -y, y_cam = 1 - z, z_cam = x.
const AHEAD = [0, -1, 0, 0, 0, 0, -1, 1, 1, 0, 0, 0];
// It looks straight down; the picture's top is ahead: x_cam = -y, y_cam = -x, z_cam = 1 - z.
const DOWN = [0, -1, 0, 0, -1, 0, 0, 0, 0, 0, -1, 1];
// It stands 0.2 m ahead and 0.1 m left of the base's centre, 1.2 m high, and looks 0.6 rad down and 0.4 rad left.
const TILTED = (() => {
  const [c, s, ct, st] = [Math.cos(0.4), Math.sin(0.4), Math.cos(0.6), Math.sin(0.6)];
  const rows = [
    [s, -c, 0],
    [-st * c, -st * s, -ct],
    [ct * c, ct * s, -st],
  ];
  return rows.flatMap((row) => [...row, -(0.2 * row[0] + 0.1 * row[1] + 1.2 * row[2])]);
})();
const LENS = [500, 500, 320, 240];
const header = (pose) => ({ lens: LENS, pose, width: 640, height: 480 });
const LEFT_M = 0.08; // the distance that the gate keeps to an obstacle
const MARGINS = { front_margin_m: LEFT_M, lateral_margin_m: 0 };
const pathOf = (outline, shown, known = [], margins = MARGINS) =>
  floorPath(outline, shown, known, margins);
const verdict = (allowed, { asked = allowed, point = null } = {}) => ({ allowed, asked, point });
const round = (points) =>
  points.map((point) => point.map((value) => Math.round(value * 100) / 100));

describe("the hull with a stretched arm", () => {
  it("is the base alone while the arm is within it", () => {
    expect(withArm(SQUARE, [])).toBe(SQUARE);
  });

  it("reaches as far as the arm, and the way is as wide as both", () => {
    const hull = withArm(SQUARE, [[0.5, 0.4, 0.1]]);
    const over = (axis) => hull.map((corner) => corner[axis]);
    expect(Math.max(...over(0))).toBeCloseTo(0.6);
    expect(Math.max(...over(1))).toBeCloseTo(0.5);
    expect(Math.min(...over(0))).toBeCloseTo(-0.3);
    const { bands } = pathOf(hull, verdict([0.4, 0, 0]));
    const sides = bands[0].outline.map(([, y]) => y);
    expect(Math.max(...sides)).toBeCloseTo(0.5);
    expect(Math.min(...sides)).toBeCloseTo(-0.2);
  });

  it("ends before what the arm would touch and the base would pass", () => {
    const beside = [150, 40]; // 1.5 m ahead, 0.4 m left
    const { stop } = pathOf(withArm(SQUARE, [[0.5, 0.4, 0.1]]), verdict([0.4, 0, 0]), beside);
    expect(stop[0][0]).toBeCloseTo(1.5 - LEFT_M, 1);
    expect(pathOf(SQUARE, verdict([0.4, 0, 0]), beside).stop).toBeNull();
  });
});

describe("the floor in the picture", () => {
  it("puts a place 2 m ahead and 0.4 m left by the pinhole", () => {
    // u = 320 + 500 * -0.4 / 2, v = 240 + 500 * 1 / 2
    expect(round(inPicture([[2, 0.4]], header(AHEAD)))).toEqual([[220, 490]]);
    expect(round(inPicture([[0.2, 0.4]], header(DOWN)))).toEqual([[120, 140]]);
  });

  it("finds the point of the floor again at its pixel, and none at the horizon or above", () => {
    for (const pose of [AHEAD, DOWN, TILTED]) {
      const point = [1.4, -0.3];
      const [pixel] = inPicture([point], header(pose));
      expect(floorAt(pixel, header(pose))).toEqual(point.map((value) => expect.closeTo(value, 9)));
    }
    expect(floorAt([320, 240], header(AHEAD))).toBe(null);
    expect(floorAt([320, 100], header(AHEAD))).toBe(null);
  });

  it("cuts off what lies behind the camera", () => {
    const square = [
      [2, 1],
      [-2, 1],
      [-2, -1],
      [2, -1],
    ];
    const cut = inPicture(square, header(AHEAD));
    expect(cut).toHaveLength(4);
    expect(round(cut)[0]).toEqual([70, 490]);
    expect(round(cut)[3]).toEqual([570, 490]);
    // 0.05 m before the lens: u = 320 ± 500 / 0.05
    expect(round([cut[1], cut[2]])).toEqual([
      [-9680, 10240],
      [10320, 10240],
    ]);
    expect(inPicture([[-1, 0]], header(AHEAD))).toEqual([]);
  });
});

describe("the way on the floor", () => {
  it("is as wide as the hull, and 4 m long before it", () => {
    const { bands, stop, later } = pathOf(SQUARE, verdict([0.5, 0, 0]));
    expect(stop).toBe(null);
    expect(bands.map(({ tier }) => tier)).toEqual(["green"]);
    const xs = bands[0].outline.map(([x]) => x);
    expect(Math.max(...xs)).toBeCloseTo(4.3);
    expect(round(bands[0].outline.slice(0, 1))).toEqual([[0, 0.2]]);
    expect(round(bands[0].outline.slice(-1))).toEqual([[0, -0.2]]);
    expect(round(later)[0]).toEqual([1.3, 0.2]); // after 2 s
  });

  it("sweeps a wider ring in a bend, as the outer corners do", () => {
    const { bands } = pathOf(SQUARE, verdict([0.5, 0, 0.5])); // a turn about (0, 1)
    const radii = bands[0].outline.map(([x, y]) => Math.hypot(x, y - 1));
    expect(Math.min(...radii)).toBeCloseTo(0.8); // the inner side
    expect(Math.max(...radii)).toBeCloseTo(Math.hypot(0.3, 1.2)); // the outer corners
  });

  it("turns to the right as it does to the left", () => {
    const left = pathOf(SQUARE, verdict([0.5, 0, 0.5])).bands[0].outline;
    const right = pathOf(SQUARE, verdict([0.5, 0, -0.5])).bands[0].outline;
    const mirrored = right.map(([x, y]) => [x, -y]).reverse();
    expect(round(mirrored)).toEqual(round(left));
  });

  it("ends yellow and red where the hull would touch", () => {
    const { bands, stop } = pathOf(SQUARE, verdict([0.5, 0, 0], { point: [2, 0] }));
    expect(bands.map(({ tier }) => tier)).toEqual(["green", "yellow", "red"]);
    expect(stop[0][0]).toBeCloseTo(2 - LEFT_M);
    expect(stop.map(([, y]) => y)).toEqual([0.2, -0.2]);
    const yellow = bands[1].outline.map(([x]) => x);
    expect(Math.max(...yellow) - Math.min(...yellow)).toBeCloseTo(0.45, 1);
  });

  it("ends before the nearest place that any sensor knows", () => {
    const known = [300, 0, 250, 10, 200, 90, -100, 0, 20, 0];
    const { stop } = pathOf(SQUARE, verdict([0.5, 0, 0]), known);
    expect(stop[0][0]).toBeCloseTo(2.5 - LEFT_M);
  });

  it("passes what is inside the circle round the hull but beside its outline", () => {
    expect(pathOf(SQUARE, verdict([0.5, 0, 0]), [200, 25]).stop).toBe(null);
    expect(pathOf(SQUARE, verdict([0.5, 0, 0]), [200, 19]).stop).not.toBe(null);
  });

  it("touches a slanted edge later than the nose", () => {
    const wedge = [
      [0.3, 0],
      [-0.3, 0.2],
      [-0.3, -0.2],
    ];
    const { stop } = pathOf(wedge, verdict([0.5, 0, 0]), [200, 10]);
    expect(stop[0][0]).toBeCloseTo(0.3 + 2 - LEFT_M); // 0.1 m to the side, the robot's edge is 0.3 m behind its nose
  });

  it("touches in a bend with the edge that comes first", () => {
    // A turn about (0, 1). The obstacle is a quarter turn further, on the circle of 1 m on which the base moves. The
    // front edge meets this circle at x = 0.3, which is asin(0.3) ahead of the base.
    const { stop } = pathOf(SQUARE, verdict([0.5, 0, 0.5]), [100, 100]);
    const goes = Math.PI / 2 - Math.asin(0.3) - LEFT_M; // radians, and metres
    const [x, y] = stop[1];
    expect(Math.atan2(x, 1 - y)).toBeCloseTo(goes + 0.3); // the nose is 0.3 m before the base's centre
    const mirrored = pathOf(SQUARE, verdict([0.5, 0, -0.5]), [100, -100]).stop[0];
    expect(mirrored[0]).toBeCloseTo(x);
    expect(mirrored[1]).toBeCloseTo(-y);
    expect(pathOf(SQUARE, verdict([0.5, 0, 0.5]), [150, 100]).stop).toBe(null);
  });

  it("ends before the margins of the robot, ahead and beside the hull", () => {
    const margins = { front_margin_m: 0.5, lateral_margin_m: 0.1 };
    const ends = (known) => pathOf(SQUARE, verdict([0.5, 0, 0]), known, margins).stop?.[0][0];
    expect(ends([200, 0])).toBeCloseTo(2 - 0.5 - 0.1); // like the gate: hull and lateral margin, then the front margin
    expect(ends([200, 29])).toBeLessThan(2 - 0.5); // 9 cm beside the hull
    expect(ends([200, 31])).toBeUndefined();
  });

  it("goes on along a wall that is nearer than the lateral margin, as the gate does", () => {
    const wall = Array.from({ length: 60 }, (_, i) => [-50 + 5 * i, 25]).flat(); // 5 cm beside the hull
    const margins = { front_margin_m: 0.08, lateral_margin_m: 0.1 };
    expect(pathOf(SQUARE, verdict([0.5, 0, 0]), wall, margins).stop).toBe(null);
    expect(pathOf(SQUARE, verdict([0.5, 0, 0], { point: [1, 0.25] }), wall, margins).stop).toBe(
      null,
    );
    expect(pathOf(SQUARE, verdict([0.5, 0, 0]), [...wall, 200, 0], margins).stop[0][0]).toBeCloseTo(
      2 - 0.08 - 0.05,
    );
  });

  it("stays green beside an obstacle that it passes", () => {
    const { bands, stop } = pathOf(SQUARE, verdict([0.5, 0, 0], { point: [2, 0.5] }));
    expect(stop).toBe(null);
    expect(bands.map(({ tier }) => tier)).toEqual(["green"]);
  });

  it("is red to the stop while the gate allows no motion", () => {
    const held = verdict([0, 0, 0], { asked: [0.5, 0, 0], point: [0.7, 0] });
    const { bands, stop, later } = pathOf(SQUARE, held);
    expect(bands.map(({ tier }) => tier)).toEqual(["red"]);
    expect(stop).not.toBe(null);
    expect(later).toBe(null);
  });

  it("goes backwards from the back of the hull", () => {
    const { bands } = pathOf(SQUARE, verdict([-0.5, 0, 0]));
    expect(Math.min(...bands[0].outline.map(([x]) => x))).toBeCloseTo(-4.3);
  });

  it.each([[[0, 0, 0]], [[0, 0, 1]]])("is nothing for the twist %s", (twist) => {
    expect(pathOf(SQUARE, verdict(twist))).toEqual({ bands: [], stop: null, later: null });
  });
});

describe("the hints at the edges of the picture", () => {
  const hints = (places, pose = AHEAD) => edgeHints(places, header(pose));

  it("names the side of what is beside the robot", () => {
    // Half the picture is atan(320 / 500) = 0.57 rad wide. Between its edge and straight behind, a place exactly to
    // the left is at 0.39 of the angle.
    const at = (1 + (Math.PI / 2 - Math.atan2(320, 500)) / (Math.PI - Math.atan2(320, 500))) / 2;
    expect(hints([0, 80])).toEqual([{ edge: "left", at: expect.closeTo(at), distanceM: 0.8 }]);
    expect(hints([0, -80])[0]).toMatchObject({ edge: "right", at: expect.closeTo(at) });
  });

  it("names the lower edge for what is before the wheels", () => {
    // 1 m ahead, 1 m below the lens: v = 240 + 500; u = 320 - 500 * 0.2 / 1
    expect(hints([100, 20])).toMatchObject([{ edge: "bottom", at: expect.closeTo(220 / 640) }]);
  });

  it("is silent about what the picture shows", () => {
    expect(hints([20, 20], DOWN)).toEqual([]);
    expect(hints([140, 140], DOWN)).toEqual([]); // farther than 1.5 m
    expect(hints([100, 0], [0, -1, 0, 0, 0, 0, -1, 0.1, 1, 0, 0, 0])).toEqual([]);
  });

  it("is silent beyond 1.5 m", () => {
    expect(hints([0, 160])).toEqual([]);
  });

  it("has the nearest one for each edge", () => {
    const found = hints([0, 120, -10, 60, 20, 140]);
    expect(found).toHaveLength(1);
    expect(found[0].distanceM).toBeCloseTo(Math.hypot(0.1, 0.6));
  });
});
