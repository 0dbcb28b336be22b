/** Speed over the last seconds: what was asked, what the gate allowed, what the odometry says. */

import UPlot from "../vendor/uplot/uPlot.esm.js";
import { coloursOf } from "./colours.js";

const WINDOW_S = 20;
const AGES_S = [15, 10, 5, 0];
const SERIES = [
  { label: () => gettext("asked"), colour: "--view-hold", dash: [4, 4] },
  { label: () => gettext("allowed"), colour: "--view-path" },
  { label: () => gettext("measured"), colour: "--view-laser" },
];

/** Columns of the last seconds, as uPlot wants them: [times, asked, allowed, measured]. */
export class SpeedTrace {
  columns = [[], [], [], []];

  add(timeS, { verdict, odometry }) {
    const row = [timeS, verdict.asked[0], verdict.allowed[0], odometry?.vx ?? null];
    for (const [i, value] of row.entries()) this.columns[i].push(value);
    while (this.columns[0][0] < timeS - WINDOW_S) for (const column of this.columns) column.shift();
  }
}

/** Drawn only where the style sheet gives it room. */
export class SpeedChart {
  #element;
  #plot = null;
  #trace = new SpeedTrace();
  #observer;
  #listening = new AbortController();

  /** @param {HTMLElement} element */
  constructor(element) {
    this.#element = element;
    this.#observer = new ResizeObserver(() => this.#rebuild());
    this.#observer.observe(element);
    const { signal } = this.#listening;
    const repaint = () => this.#rebuild();
    document.addEventListener("fleet:theme", repaint, { signal });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint, { signal });
  }

  add(state) {
    const now = performance.now() / 1000;
    this.#trace.add(now, state);
    this.#plot?.setData(this.#trace.columns, false);
    this.#plot?.setScale("x", { min: now - WINDOW_S, max: now });
  }

  close() {
    this.#listening.abort();
    this.#observer.disconnect();
    this.#plot?.destroy();
  }

  #rebuild() {
    this.#plot?.destroy();
    this.#plot = null;
    const { clientWidth: width, clientHeight: height } = this.#element;
    if (width < 100 || height < 80) return;
    const names = ["--ink-quiet", "--line", ...SERIES.map(({ colour }) => colour)];
    const [ink, line, ...lines] = coloursOf(this.#element, names);
    const axis = {
      stroke: ink,
      grid: { stroke: line, width: 1 },
      ticks: { show: false },
    };
    const options = {
      width,
      height: height - 26, // the legend's line
      cursor: { show: false },
      scales: {
        x: { time: false },
        y: { range: (_, low, high) => [Math.min(low ?? 0, -0.1), Math.max(high ?? 0, 0.5)] },
      },
      axes: [
        {
          ...axis,
          splits: (plot) => AGES_S.map((age) => plot.scales.x.max - age),
          values: () => AGES_S.map((age) => (age ? `−${age} s` : gettext("now"))),
          size: 24,
        },
        { ...axis, values: (_, ticks) => ticks.map((v) => v.toFixed(1)), size: 36 },
      ],
      series: [
        {},
        ...SERIES.map(({ label, dash }, i) => ({
          label: label(),
          stroke: lines[i],
          width: 2,
          dash,
          points: { show: false },
        })),
      ],
      legend: { live: false },
    };
    this.#plot = new UPlot(options, this.#trace.columns, this.#element);
  }
}
