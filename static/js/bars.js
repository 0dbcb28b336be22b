/** Bars over days, hours or weekdays. */

import UPlot from "../vendor/uplot/uPlot.esm.js";
import { coloursOf } from "./colours.js";

const LEAST_HOURS = 0.1; // a chart of no driving is not all blank
const PIXELS_PER_LABEL = 56;

/** Redrawn when its room or the colours change. */
export class Bars {
  #element;
  #labels;
  #data;
  #plot = null;

  /** @param {HTMLElement} element @param {string[]} labels one for each bar @param {number[]} hours */
  constructor(element, labels, hours) {
    this.#element = element;
    this.#labels = labels;
    this.#data = [labels.map((_, i) => i), hours];
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
    const every = Math.ceil(count / Math.max(width / PIXELS_PER_LABEL, 1));
    const shown = this.#data[0].filter((i) => i % every === 0);
    const axis = { stroke: ink, ticks: { show: false } };
    const options = {
      width,
      height,
      cursor: { show: false },
      legend: { show: false },
      scales: {
        x: { time: false, range: [-0.5, count - 0.5] },
        y: { range: (_, _low, high) => [0, Math.max(high ?? 0, LEAST_HOURS) * 1.05] },
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
          values: (_, ticks) => ticks.map((hours) => `${hours} h`),
          size: 56,
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
