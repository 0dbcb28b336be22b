/** Numbers of messages over time: one plot, a line for each field that was chosen. */

import UPlot from "../../vendor/uplot/uPlot.esm.js";
import { coloursOf } from "../colours.js";

const WINDOW_S = 30;
const COLOURS = ["--view-path", "--view-hold", "--view-laser", "--accent", "--warn", "--ink"];
export const LINES_AT_MOST = COLOURS.length;

/** Columns of the last seconds, as uPlot wants them: [times, first line, second line, ...]. Pure. */
export class Trace {
  columns = [[]];
  #names = [];

  /** @param {string[]} names of the lines; what is new begins empty, what is gone is forgotten */
  set names(names) {
    const [times] = this.columns;
    const kept = names.map((name) => {
      const before = this.#names.indexOf(name);
      return before < 0 ? times.map(() => null) : this.columns[before + 1];
    });
    this.columns = [times, ...kept];
    this.#names = [...names];
  }

  get names() {
    return this.#names;
  }

  /** @param {Map<string, ?number>} values by name; lines that are not in it keep a gap */
  add(timeS, values) {
    const [times, ...lines] = this.columns;
    times.push(timeS);
    for (const [i, line] of lines.entries()) line.push(values.get(this.#names[i]) ?? null);
    while (times[0] < timeS - WINDOW_S) for (const column of this.columns) column.shift();
  }
}

export class FieldPlot {
  #element;
  #plot = null;
  #trace = new Trace();
  #observer;

  /** @param {HTMLElement} element */
  constructor(element) {
    this.#element = element;
    this.#observer = new ResizeObserver(() => this.#rebuild());
    this.#observer.observe(element);
  }

  get names() {
    return this.#trace.names;
  }

  set names(names) {
    this.#trace.names = names;
    this.#element.hidden = names.length === 0;
    this.#rebuild();
  }

  add(values) {
    const now = performance.now() / 1000;
    this.#trace.add(now, values);
    this.#plot?.setData(this.#trace.columns, false);
    this.#plot?.setScale("x", { min: now - WINDOW_S, max: now });
  }

  close() {
    this.#observer.disconnect();
    this.#plot?.destroy();
  }

  #rebuild() {
    this.#plot?.destroy();
    this.#plot = null;
    const { clientWidth: width, clientHeight: height } = this.#element;
    if (width < 100 || height < 80 || !this.names.length) return;
    const [ink, line, ...lines] = coloursOf(this.#element, ["--ink-quiet", "--line", ...COLOURS]);
    const axis = {
      stroke: ink,
      grid: { stroke: line, width: 1 },
      ticks: { show: false },
    };
    this.#plot = new UPlot(
      {
        width,
        height: height - 26 * Math.ceil(this.names.length / 2), // the legend's lines
        cursor: { show: false },
        scales: { x: { time: false } },
        axes: [
          {
            ...axis,
            values: (plot, ticks) => ticks.map((t) => `${Math.round(t - plot.scales.x.max)} s`),
          },
          { ...axis, size: 56 },
        ],
        series: [
          {},
          ...this.names.map((label, i) => ({
            label,
            stroke: lines[i],
            width: 2,
            points: { show: false },
          })),
        ],
        legend: { live: false },
      },
      this.#trace.columns,
      this.#element,
    );
  }
}
