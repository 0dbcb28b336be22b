/** Bars over days, hours or weekdays: how long a robot was driven. */

import UPlot from "../vendor/uplot/uPlot.esm.js";
import { coloursOf } from "./colours.js";

const LEAST = 1; // hour or minute: a chart of no driving has an axis
const AXIS_PIXELS = 56;
const PIXELS_PER_LABEL = 56;

/** Minutes as long as none of it is an hour. @param {number[]} hours */
export function inUnits(hours) {
  if (Math.max(...hours) >= 1) return { unit: gettext("h"), values: hours };
  return { unit: gettext("min"), values: hours.map((value) => value * 60) };
}

/** Redrawn when its room or the colours change. */
export class Bars {
  #element;
  #labels;
  #data;
  #unit;
  #plot = null;

  /** @param {HTMLElement} element @param {string[]} labels one for each bar @param {number[]} hours */
  constructor(element, labels, hours) {
    this.#element = element;
    this.#labels = labels;
    const { unit, values } = inUnits(hours);
    this.#unit = unit;
    this.#data = [labels.map((_, i) => i), values];
    new ResizeObserver(() => this.#rebuild()).observe(element);
    const repaint = () => this.#rebuild();
    document.addEventListener("fleet:theme", repaint);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  }

  #rebuild() {
    this.#plot?.destroy();
    this.#plot = null;
    const { clientWidth: width, clientHeight: height } = this.#element;
    if (width < 100 || height < 80) return;
    const [ink, line, bar] = coloursOf(this.#element, ["--ink-quiet", "--line", "--accent"]);
    const count = this.#labels.length;
    const every = Math.ceil(count / Math.max((width - AXIS_PIXELS) / PIXELS_PER_LABEL, 1));
    const shown = this.#data[0].filter((i) => i % every === 0);
    const axis = { stroke: ink, ticks: { show: false } };
    const options = {
      width,
      height,
      cursor: { show: false },
      legend: { show: false },
      scales: {
        x: { time: false, range: [-0.5, count - 0.5] },
        y: { range: (_, _low, high) => [0, Math.max(high ?? 0, LEAST) * 1.02] },
      },
      axes: [
        {
          ...axis,
          grid: { show: false },
          splits: () => shown,
          values: () => shown.map((i) => this.#labels[i]),
          size: 28,
        },
        {
          ...axis,
          grid: { stroke: line, width: 1 },
          values: (_, ticks) => ticks.map((tick) => `${tick} ${this.#unit}`),
          size: AXIS_PIXELS,
        },
      ],
      series: [
        {},
        {
          fill: bar,
          stroke: bar,
          width: 0,
          paths: UPlot.paths.bars({ size: [0.7, 48], align: 0 }),
          points: { show: false },
        },
      ],
    };
    this.#plot = new UPlot(options, this.#data, this.#element);
  }
}
