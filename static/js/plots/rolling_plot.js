/** Numbers over the last seconds, as lines: now is at the right edge. */

import { Plot } from "./uplot.js";

/** Columns of the last seconds, as uPlot wants them: [times, first line, second line, ...]. Pure. */
export class Trace {
  columns = [[]];
  #names = [];
  #windowS;

  /** @param {number} windowS older values are removed */
  constructor(windowS) {
    this.#windowS = windowS;
  }

  /**
   * @param {string[]} names of the lines; a new line begins empty, a line that is not named any more is
   *   removed
   */
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

  /** @param {Map<string, ?number>} values by name; a line without a value gets a gap */
  add(timeS, values) {
    const [times, ...lines] = this.columns;
    times.push(timeS);
    for (const [i, line] of lines.entries()) line.push(values.get(this.#names[i]) ?? null);
    while (times[0] < timeS - this.#windowS) for (const column of this.columns) column.shift();
  }
}

/** A trace on a page, with a legend. */
export class RollingPlot {
  #trace;
  #windowS;
  #plot;

  /**
   * @param {HTMLElement} element
   * @param {{windowS: number, stepS: number}} the time that is shown, and the time between two marks
   * @param {(given: object) => object} look as of `Plot`, but with `lines` (label, colour, dash) in place of
   *   series, and with `y` (options of the y axis) in place of axes
   */
  constructor(element, { windowS, stepS }, look) {
    this.#trace = new Trace(windowS);
    this.#windowS = windowS;
    this.#plot = new Plot(
      element,
      () => this.#trace.columns,
      (given) => {
        const { lines, y, scales, legend, ...options } = look(given);
        const strokes = given.colours(lines.map(({ colour }) => colour));
        const markers = { dash: (plot, i) => (plot.series[i].dash ? "dashed" : "solid") };
        return {
          legend: { live: false, markers, ...legend },
          scales: { x: { time: false }, ...scales },
          axes: [
            { ...given.axis, ...ages(windowS, stepS) },
            { ...given.axis, ...y },
          ],
          series: [
            {},
            ...lines.map(({ label, dash }, i) => ({
              label,
              stroke: strokes[i],
              width: 2,
              dash,
              points: { show: false },
            })),
          ],
          ...options,
        };
      },
    );
  }

  get names() {
    return this.#trace.names;
  }

  set names(names) {
    this.#trace.names = names;
    this.#plot.redraw();
  }

  /** @param {?Map<string, ?number>} current values, by name; null: no values, only the time axis moves */
  add(values) {
    const now = performance.now() / 1000;
    if (values) this.#trace.add(now, values);
    this.#plot.slide(now - this.#windowS, now);
  }

  close() {
    this.#plot.close();
  }
}

/** Labels of the time axis: how long ago. */
function ages(windowS, stepS) {
  const agesS = Array.from({ length: windowS / stepS }, (_, i) => windowS - stepS * (i + 1));
  return {
    splits: (plot) => agesS.map((age) => plot.scales.x.max - age),
    values: () => agesS.map((age) => (age ? `−${age} s` : gettext("now"))),
    size: 24,
  };
}
