import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { PlanView } from "../../../static/js/drive/plan_view.js";

const FACTS = {
  sonars: [],
  footprint: [
    [0.3, 0.2],
    [-0.3, 0.2],
    [-0.3, -0.2],
    [0.3, -0.2],
  ],
};

/** A drawing context that stores every call, and its settings. */
function recorder() {
  const calls = [];
  const measured = { width: 10 };
  const pen = new Proxy(
    {},
    {
      get: (set, name) => {
        if (name in set) return set[name];
        return name === "measureText" ? () => measured : (...facts) => calls.push([name, ...facts]);
      },
      set: (set, name, value) => {
        set[name] = value;
        return calls.push([name, value]) > 0;
      },
    },
  );
  return { pen, calls };
}

describe("the picture from above", () => {
  let calls;
  let picture;

  beforeEach(() => {
    vi.stubGlobal(
      "ResizeObserver",
      class {
        observe() {}
        disconnect() {}
      },
    );
    vi.stubGlobal("requestAnimationFrame", (act) => {
      act();
      return null;
    });
    const canvas = document.createElement("canvas");
    document.body.append(canvas);
    canvas.width = canvas.height = 400;
    const recorded = recorder();
    calls = recorded.calls;
    canvas.getContext = () => recorded.pen;
    picture = new PlanView({ parts: { picture: canvas } });
  });

  afterEach(() => {
    picture.close();
    vi.unstubAllGlobals();
  });

  const view = (scan) => ({ state: { verdict: { allowed: [0, 0, 0], point: null } }, scan });
  const scan = { laser_cm: [], sonar_cm: [], depth_cm: [], remembered_cm: [] };
  const sectors = () => calls.filter(([name, , , radius]) => name === "arc" && radius === 1.5);

  it("is pale while the robot is silent, the ghost in it, too", () => {
    picture.facts = FACTS;
    picture.view = view(scan);
    const ghost = { ghost: FACTS.footprint, floor: FACTS.footprint, nose: [1, 0], problem: "" };
    picture.stale = true;
    calls.length = 0;
    picture.ghost = ghost;
    const strengths = calls.filter(([name]) => name === "globalAlpha").map(([, value]) => value);
    expect(strengths.slice(-3)).toEqual([0.5, expect.closeTo(0.06), 0.5]);
  });

  it("shades the sectors that no sensor sees", () => {
    picture.facts = FACTS;
    picture.view = view({
      ...scan,
      unseen: [
        [2.5, 2.9],
        [-2.9, -2.5],
      ],
    });
    expect(sectors()).toEqual([
      ["arc", 0, 0, 1.5, 2.5, 2.9],
      ["arc", 0, 0, 1.5, -2.9, -2.5],
    ]);
  });

  it("shades nothing when an older bridge reports no sectors", () => {
    picture.facts = FACTS;
    picture.view = view(scan);
    picture.view = view(null);
    expect(sectors()).toEqual([]);
  });

  it("draws the arm as one, with its name at the far end", () => {
    picture.facts = FACTS;
    calls.length = 0;
    const arm = [
      [0.3, 0, 0.09],
      [0.5, -0.1, 0.09],
    ];
    const shown = view(scan);
    shown.state.arm = arm;
    picture.view = shown;
    const lines = calls.filter(([name]) => name === "lineTo").map(([, x, y]) => [x, y]);
    for (const [x, y] of arm) expect(lines).toContainEqual([x, y]);
    expect(calls.filter(([name, text]) => name === "fillText" && text === "arm")).toHaveLength(1);
  });
});
