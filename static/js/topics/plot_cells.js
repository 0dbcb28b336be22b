/** The plots of a layout. They share one connection, which is open only while a cell shows a plot. */

import { socketUrl } from "../connection/socket.js";
import { CELLS, isPlot } from "../control/layout/cells.js";
import { TopicsChannel } from "./channel.js";
import { PlotCell } from "./plot_cell.js";

const RATE_HZ = 5;

export class PlotCells {
  static hears = ["cells", "plotShown", "stale"];
  #template;
  #tell;
  #channel;
  #plots = [];
  #topics = null; // names of the robot's topics; null: not known yet
  #newest = new Map(); // the newest sample of each subscribed topic; null: none yet
  #words = ""; // why no topic is read
  #isShown = false;
  #isStale = false;
  #listening = new AbortController();

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ root, parts, tell }) {
    this.#template = parts["plot-template"];
    this.#tell = tell;
    this.#channel = new TopicsChannel(socketUrl(root.dataset.topics));
    const { signal } = this.#listening;
    this.#channel.addEventListener("open", () => this.#readTopics(), { signal });
    this.#channel.addEventListener("refused", ({ detail }) => this.#say(detail.text), { signal });
  }

  /** @param {?string[]} cells contents of the own layout; null: there is none */
  set cells(cells) {
    const left = [...this.#plots];
    this.#plots = (cells ?? []).flatMap((content, at) => {
      if (!isPlot(content)) return [];
      const found = left.findIndex((plot) => plot.content === content);
      const plot = found < 0 ? this.#make(content) : left.splice(found, 1)[0];
      plot.cell = CELLS[at];
      return [plot];
    });
    for (const plot of left) plot.close();
    this.#subscribe();
  }

  /** @param {boolean} shown whether cells show plots: only then topics are read */
  set plotShown(shown) {
    if (shown === this.#isShown) return;
    this.#isShown = shown;
    if (shown) this.#channel.open();
    else this.#channel.close();
  }

  set stale(stale) {
    this.#isStale = stale;
    for (const plot of this.#plots) plot.stale = stale;
  }

  close() {
    this.#listening.abort();
    this.#channel.close();
    for (const plot of this.#plots) plot.close();
  }

  #make(content) {
    const element = this.#template.content.firstElementChild.cloneNode(true);
    this.#template.before(element);
    const plot = new PlotCell(element, content);
    plot.stale = this.#isStale;
    if (this.#topics) plot.topics = this.#topics;
    plot.addEventListener("choose", () => this.#chosen(element, plot));
    plot.say(this.#words);
    return plot;
  }

  #chosen(element, plot) {
    const newest = this.#newest.get(plot.topic);
    if (newest) plot.take(newest); // another plot reads this topic
    const at = CELLS.indexOf(element.dataset.cell);
    this.#tell({ plotted: { at, content: plot.content } });
  }

  /** Read the topics of all plots, each once. */
  #subscribe() {
    const topics = new Set(this.#plots.map(({ topic }) => topic).filter(Boolean));
    for (const topic of [...this.#newest.keys()])
      if (!topics.has(topic)) {
        this.#newest.delete(topic);
        this.#channel.unsubscribe(topic);
      }
    for (const topic of topics)
      if (!this.#newest.has(topic)) {
        this.#newest.set(topic, null);
        this.#channel.subscribe(topic, RATE_HZ, (sample) => this.#take(topic, sample));
      }
  }

  #take(topic, sample) {
    this.#newest.set(topic, sample);
    for (const plot of this.#plots) if (plot.topic === topic) plot.take(sample);
  }

  async #readTopics() {
    this.#say(gettext("Asking the robot…"));
    try {
      const { topics } = await this.#channel.ask({ t: "topics" });
      this.#topics = topics.map(({ name }) => name);
      this.#words = "";
      for (const plot of this.#plots) plot.topics = this.#topics;
    } catch (error) {
      if (!this.#listening.signal.aborted) this.#say(error.message);
    }
  }

  #say(text) {
    this.#words = text;
    for (const plot of this.#plots) plot.say(text);
  }
}
