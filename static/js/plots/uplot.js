/** Common parts of all plots: plain axes, the page's colours, redraw when size or colours change. */

import { coloursOf, onNewColours } from "../lib/colours.js";
import { loadUPlot } from "./load.js";

const LEAST_WIDTH = 100;
const LEAST_HEIGHT = 80;
const LEGEND_ROW = 26;

let UPlot = null; // until the first plot has room
let loading = null;

async function load() {
  loading ??= loadUPlot();
  try {
    UPlot = await loading;
  } catch {
    loading = null; // without a network; the next size or colour tries again
  }
}

/** A uPlot that fills its element. It is not drawn while the element is too small. */
export class Plot {
  #element;
  #columns;
  #look;
  #drawn = null;
  #observer;
  #listening = new AbortController();

  /**
   * @param {HTMLElement} element
   * @param {() => Array<Array<?number>>} columns the data, as uPlot wants them
   * @param {(given: {axis: object, colours: (names: string[]) => string[], paths: object}) => object} look uPlot's
   *   options without the size; `legendRows`: rows that are kept free below the plot; `paths`: of uPlot
   */
  constructor(element, columns, look) {
    this.#element = element;
    this.#columns = columns;
    this.#look = look;
    const redraw = () => this.redraw();
    this.#observer = new ResizeObserver(redraw);
    this.#observer.observe(element);
    onNewColours(redraw, this.#listening.signal);
  }

  redraw() {
    this.#drawn?.destroy();
    this.#drawn = null;
    const { clientWidth: width, clientHeight } = this.#element;
    if (width < LEAST_WIDTH || clientHeight < LEAST_HEIGHT) return;
    if (!UPlot) {
      this.#drawLater();
      return;
    }
    const colours = (names) => coloursOf(this.#element, names);
    const [stroke, line] = colours(["--ink-quiet", "--line"]);
    const axis = { stroke, grid: { stroke: line, width: 1 }, ticks: { show: false } };
    const { legendRows = 0, ...options } = this.#look({ axis, colours, paths: UPlot.paths });
    const height = clientHeight - LEGEND_ROW * legendRows;
    this.#drawn = new UPlot(
      { width, height, cursor: { show: false }, ...options },
      this.#columns(),
      this.#element,
    );
    const taken = clientHeight - this.#element.clientHeight; // by a legend beside the element
    if (taken > 0) this.#drawn.setSize({ width, height: height - taken });
  }

  async #drawLater() {
    await load();
    if (UPlot && !this.#listening.signal.aborted) this.redraw();
  }

  /** The columns have changed: show those from `least` to `most` on the x axis. */
  slide(least, most) {
    this.#drawn?.setData(this.#columns(), false);
    this.#drawn?.setScale("x", { min: least, max: most });
  }

  close() {
    this.#listening.abort();
    this.#observer.disconnect();
    this.#drawn?.destroy();
  }
}
