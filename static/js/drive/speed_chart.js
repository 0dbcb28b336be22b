/** Speed over the last seconds: as asked, as allowed by the gate, as measured by the odometry. */

import { number } from "../formats/numbers.js";
import { RollingPlot } from "../plots/rolling_plot.js";

const TIME = { windowS: 20, stepS: 5 };
const LINES = [
  { name: "asked", label: () => gettext("asked"), colour: "--view-hold", dash: [4, 4] },
  { name: "allowed", label: () => gettext("allowed"), colour: "--view-path" },
  { name: "measured", label: () => gettext("measured"), colour: "--view-laser" },
];

/** Return the forward speeds of a robot's state, m/s, by the name of their line. */
export function speedsOf({ verdict, odometry }) {
  return new Map([
    ["asked", verdict.asked[0]],
    ["allowed", verdict.allowed[0]],
    ["measured", odometry?.vx],
  ]);
}

export class SpeedChart {
  static hears = ["state"];
  #plot;

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ parts }) {
    this.#plot = new RollingPlot(parts.chart, TIME, () => ({
      lines: LINES.map(({ label, ...line }) => ({ ...line, label: label() })),
      legendRows: 1,
      scales: {
        y: { range: (_, low, high) => [Math.min(low ?? 0, -0.1), Math.max(high ?? 0, 0.5)] },
      },
      y: { values: (_, ticks) => ticks.map((v) => number(v, 1)), size: 36 },
    }));
    this.#plot.names = LINES.map(({ name }) => name);
  }

  /** @param {object} state of the robot */
  set state(state) {
    this.#plot.add(speedsOf(state));
  }

  close() {
    this.#plot.close();
  }
}
