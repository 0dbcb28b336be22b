import { beforeEach, describe, expect, it } from "vitest";
import { Interventions } from "../../../../static/js/control/reason/interventions.js";

const wall = (vx) => ({ code: "obstacle", sensor: "/scan", side: "ahead", allowed: [vx, 0, 0] });

describe("the reasons why the robot was slow or stood", () => {
  let reasons;
  beforeEach(() => {
    reasons = new Interventions();
  });

  it("stay for five seconds after the stick is released", () => {
    reasons.add(wall(0), "stopped: laser, 0.4 m ahead", 1000);
    reasons.add({ code: "idle", allowed: [0, 0, 0] }, null, 1100);
    expect(reasons.recent(5900)).toBe("stopped: laser, 0.4 m ahead");
    expect(reasons.recent(6100)).toBeNull();
  });

  it("keep their way out while the stick returns and the robot is only slowed", () => {
    const stands = { title: "Something is 0.4 m ahead", act: "back_off" };
    reasons.add(wall(0), stands, 1000);
    reasons.add(wall(0.05), { title: "Slower: something is 0.4 m ahead" }, 1100);
    expect(reasons.recent(5900)).toBe(stands);
    expect(reasons.recent(6050).title).toMatch(/^Slower/);
    reasons.add({ code: "scan_stale", allowed: [0, 0, 0] }, { title: "The laser is silent" }, 1200);
    expect(reasons.recent(5900).title).toBe("The laser is silent");
  });

  it("are one while they go on, with the newest words and the lowest speed", () => {
    const at = new Date(0);
    reasons.add(wall(0.3), "slowed", 0, at);
    reasons.add(wall(0), "stopped", 100, new Date(100));
    reasons.add(wall(0.1), "slowed again", 200, new Date(200));
    expect(reasons.list).toMatchObject([{ reason: "slowed again", limit: 0, at }]);
  });

  it("are the last five, the newest first", () => {
    for (let number = 0; number < 7; number += 1)
      reasons.add({ code: `rule ${number}`, allowed: [0.1, 0, 0] }, `reason ${number}`, number);
    const texts = reasons.list.map(({ reason }) => reason);
    expect(texts).toEqual(["reason 6", "reason 5", "reason 4", "reason 3", "reason 2"]);
  });
});
