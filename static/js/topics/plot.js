/** Numbers of messages over time: one plot, a line for each field that was chosen. */

import { RollingPlot } from "../rolling.js";

const WINDOW_S = 30;
const COLOURS = ["--view-path", "--view-hold", "--view-laser", "--accent", "--warn", "--ink"];
const LABELS_IN_A_ROW = 2; // of the legend
export const LINES_AT_MOST = COLOURS.length;

export class FieldPlot {
  #element;
  #plot;

  /** @param {HTMLElement} element */
  constructor(element) {
    this.#element = element;
    this.#plot = new RollingPlot(element, WINDOW_S, ({ axis }) => ({
      lines: this.names.map((label, i) => ({ label, colour: COLOURS[i] })),
      legendRows: Math.ceil(this.names.length / LABELS_IN_A_ROW),
      axes: [
        {
          ...axis,
          values: (plot, ticks) => ticks.map((t) => `${Math.round(t - plot.scales.x.max)} s`),
        },
        { ...axis, size: 56 },
      ],
    }));
  }

  get names() {
    return this.#plot.names;
  }

  set names(names) {
    this.#element.hidden = names.length === 0; // hence without room for a plot
    this.#plot.names = names;
  }

  /** @param {Map<string, ?number>} values of now, by name */
  add(values) {
    this.#plot.add(values);
  }

  close() {
    this.#plot.close();
  }
}
