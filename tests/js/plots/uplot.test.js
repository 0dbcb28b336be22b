import { beforeEach, describe, expect, it, vi } from "vitest";

const drawn = vi.hoisted(() => []);
const loadUPlot = vi.hoisted(() => vi.fn());
let Plot;

vi.mock("../../../static/js/plots/load.js", () => ({ loadUPlot }));

function library() {
  class UPlot {
    static paths = { bars: () => () => null };
    destroy = vi.fn();
    setData = vi.fn();
    setScale = vi.fn();
    setSize = vi.fn();

    constructor(options, columns) {
      Object.assign(this, { options, columns });
      drawn.push(this);
    }
  }
  return UPlot;
}

function element(width, height) {
  const room = document.createElement("div");
  Object.defineProperties(room, {
    clientWidth: { get: () => width, configurable: true },
    clientHeight: { get: () => height, configurable: true },
  });
  document.body.append(room);
  return room;
}

describe("a plot", () => {
  beforeEach(async () => {
    drawn.splice(0);
    vi.resetModules();
    ({ Plot } = await import("../../../static/js/plots/uplot.js"));
    loadUPlot.mockReset().mockResolvedValue(library());
  });

  /** uPlot is loaded, as after another plot. */
  async function loaded() {
    const plot = new Plot(
      element(300, 200),
      () => [[0]],
      () => ({}),
    );
    plot.redraw();
    await vi.waitFor(() => expect(drawn).toHaveLength(1));
    plot.close();
    drawn.splice(0);
  }

  it("loads uPlot when it has room, and again after the network failed", async () => {
    loadUPlot.mockRejectedValueOnce(new TypeError("no network"));
    let width = 0;
    const room = element(0, 200);
    Object.defineProperty(room, "clientWidth", { get: () => width });
    const plot = new Plot(
      room,
      () => [[0]],
      () => ({}),
    );
    plot.redraw();
    expect(loadUPlot).not.toHaveBeenCalled();
    width = 300;
    plot.redraw();
    await vi.waitFor(() => expect(loadUPlot).toHaveBeenCalledTimes(1));
    await Promise.resolve();
    expect(drawn).toEqual([]);
    plot.redraw();
    await vi.waitFor(() => expect(drawn).toHaveLength(1));
    plot.close();
  });

  it("leaves room for its legend, and needs room to be drawn", async () => {
    await loaded();
    const look = () => ({ legendRows: 2 });
    for (const height of [200, 40]) {
      const plot = new Plot(element(300, height), () => [[0]], look);
      plot.redraw();
      plot.close();
    }
    expect(drawn.map(({ options }) => [options.width, options.height])).toEqual([[300, 148]]);
  });

  it("gives up the room that a legend beside it takes", async () => {
    await loaded();
    const room = element(300, 200);
    const left = { get: () => (drawn.length > 0 ? 146 : 200) };
    Object.defineProperty(room, "clientHeight", { ...left, configurable: true });
    const plot = new Plot(
      room,
      () => [[0]],
      () => ({}),
    );
    plot.redraw();
    plot.close();
    expect(drawn[0].setSize).toHaveBeenCalledWith({ width: 300, height: 146 });
  });

  it("is redrawn in a new theme's colours until it is closed", async () => {
    await loaded();
    const columns = [[0], [1]];
    const plot = new Plot(
      element(300, 200),
      () => columns,
      () => ({}),
    );
    plot.redraw();
    columns[0].push(1);
    columns[1].push(2);
    document.dispatchEvent(new CustomEvent("fleet:theme"));
    expect(drawn).toHaveLength(2);
    expect(drawn[0].destroy).toHaveBeenCalled();
    expect(drawn[1].columns).toEqual([
      [0, 1],
      [1, 2],
    ]);
    plot.close();
    document.dispatchEvent(new CustomEvent("fleet:theme"));
    expect(drawn).toHaveLength(2);
  });
});
