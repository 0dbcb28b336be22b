import { describe, expect, it } from "vitest";
import { Pace } from "../../../static/js/scene/pace.js";

const COUNT = 15;
const draw = (pace, ms, times = COUNT) =>
  Array.from({ length: times }, () => pace.addFrameTime(ms)).some(Boolean);

describe("how fine the 3D picture is", () => {
  it("is as fine as the page without a graphics processor, and twice as fine with one", () => {
    expect(new Pace(true).ratio(400, 300, 3)).toBe(1);
    expect(new Pace(false).ratio(400, 300, 3)).toBe(2);
    expect(new Pace(false).ratio(400, 300, 1)).toBe(1);
  });

  it("has a limit of pixels", () => {
    const ratio = new Pace(true).ratio(2000, 2000, 1);
    expect((2000 * ratio) ** 2).toBeCloseTo(1e6);
  });

  it("becomes coarser while pictures take too long, down to a half", () => {
    const pace = new Pace(true);
    expect(draw(pace, 60)).toBe(true);
    expect(pace.ratio(400, 300, 1)).toBeCloseTo(0.85);
    for (let i = 0; i < 20; i += 1) draw(pace, 60);
    expect(pace.ratio(400, 300, 1)).toBe(0.5);
  });

  it("becomes finer again only after many good counts", () => {
    const pace = new Pace(true);
    draw(pace, 60);
    expect(draw(pace, 25, 7 * COUNT)).toBe(false);
    expect(draw(pace, 25, COUNT)).toBe(true);
    expect(pace.ratio(400, 300, 1)).toBeCloseTo(1);
  });

  it("leaves the page a third of its time, also after a pause", () => {
    const pace = new Pace(true);
    pace.tookMs = 10;
    expect(pace.leastMs).toBe(25);
    pace.tookMs = 100;
    expect(pace.leastMs).toBe(150);
    pace.tookMs = 60_000;
    expect(pace.leastMs).toBe(750);
  });

  it("does not count a pause of the page", () => {
    const pace = new Pace(true);
    expect(draw(pace, 2000, 5 * COUNT)).toBe(false);
  });
});
