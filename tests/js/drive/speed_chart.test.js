import { describe, expect, it } from "vitest";
import { speedsOf } from "../../../static/js/drive/speed_chart.js";

describe("the speeds on the chart", () => {
  it("are forward speeds, without odometry no measured one", () => {
    const verdict = { asked: [0.4, 0, 1], allowed: [0.3, 0, 0.5] };
    const entries = speedsOf({ verdict, odometry: { vx: 0.25, w: 0.4 } });
    expect([...entries]).toEqual([
      ["asked", 0.4],
      ["allowed", 0.3],
      ["measured", 0.25],
    ]);
    expect(speedsOf({ verdict, odometry: null }).get("measured")).toBeUndefined();
  });
});
