/** Numbers of a topic's messages over time: a line for each field that was chosen. */

import { make } from "../lib/dom.js";
import { RollingPlot } from "../plots/rolling_plot.js";
import { numberAt } from "./fields.js";

const TIME = { windowS: 30, stepS: 10 };
const COLOURS = ["--view-path", "--view-hold", "--view-laser"];
const LOOKS = [undefined, [6, 4]].flatMap((dash) => COLOURS.map((colour) => ({ colour, dash })));
const LINES_AT_MOST = LOOKS.length;

export class FieldPlot {
  #element;
  #plot;

  /** @param {HTMLElement} element is filled with plot and legend, and hidden while there is no line */
  constructor(element) {
    this.#element = element;
    const [room, below] = [make("div", { className: "plot-room" }), make("div")];
    element.replaceChildren(room, below);
    element.hidden = true;
    this.#plot = new RollingPlot(room, TIME, () => ({
      lines: this.names.map((label, i) => ({ label, ...LOOKS[i] })),
      legend: { mount: (_, legend) => below.replaceChildren(legend) },
      y: { size: 56 },
    }));
  }

  /** Paths of the fields that have a line. */
  get names() {
    return this.#plot.names;
  }

  /**
   * Add or remove lines.
   * @param {boolean} on true: the field gets a line; false: the field, or the list's elements, lose theirs
   * @returns {string} why not, or ""
   */
  put(path, on) {
    const others = this.names.filter((name) => name !== path && !name.startsWith(`${path}[`));
    if (on && others.length >= LINES_AT_MOST) {
      return interpolate(gettext("A plot has at most %s lines."), [LINES_AT_MOST]);
    }
    const names = on ? [...others, path] : others;
    this.#element.hidden = names.length === 0; // then the plot has no room and is not drawn
    this.#plot.names = names;
    return "";
  }

  /** @param {?object} fields of a new message; null: no message, only the time axis moves */
  add(fields) {
    this.#plot.add(fields && new Map(this.names.map((path) => [path, numberAt(fields, path)])));
  }

  close() {
    this.#plot.close();
  }
}
