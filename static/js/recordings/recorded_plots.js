/** Plots of recorded numbers: each chosen field has one, all on the time of the replay. */

import { readJson } from "../connection/read.js";
import { make, makeButton, setTextOrHide } from "../lib/dom.js";
import { Plot } from "../plots/uplot.js";
import { topics } from "./channels.js";

const WHOLE_S = 180; // a recording that lasts no longer is read as a whole
const BLOCK_S = 120; // else so much of it around the moment
const PLOTS_AT_MOST = 6;

/** Return the time that is plotted around a moment, within its part. Pure. */
export function plotted(atS, [begin, end]) {
  if (end - begin <= WHOLE_S) return [begin, end];
  const from = Math.floor(atS / BLOCK_S) * BLOCK_S;
  return [Math.max(begin, from), Math.min(end, from + BLOCK_S)];
}

class FieldOverTime {
  element;
  #address;
  #topic;
  #field;
  #plot;
  #columns = [[], []];
  #window = [0, 0];
  #atS = 0;

  constructor(address, topic, field, close) {
    this.#address = address;
    this.#topic = topic;
    this.#field = field;
    const room = make("div", { className: "plot-room" });
    const name = make("span", { text: `${topic} ${field}` });
    const button = makeButton({ className: "close", text: "×" }, () => close(this));
    button.setAttribute("aria-label", interpolate(gettext("Remove %s"), [field]));
    const head = make("p", { className: "plot-name", children: [name, button] });
    this.element = make("section", { children: [head, room] });
    this.#plot = new Plot(
      room,
      () => this.#columns,
      ({ axis, colours }) => this.#look(axis, colours(["--view-path", "--view-hold"])),
    );
  }

  /** @param {number} atS @param {[number, number]} part */
  async show(atS, part) {
    this.#atS = atS;
    const window = plotted(atS, part);
    if (String(window) !== String(this.#window)) {
      this.#window = window;
      const [from, to] = window;
      const asked = new URLSearchParams({ topic: this.#topic, field: this.#field, from, to });
      const series = await readJson(
        `${this.#address}/series?${asked}`,
        gettext("The numbers could not be read."),
      );
      if (this.#window !== window) return; // another one was asked for since
      this.#columns = [series.at_s, series.values];
    }
    this.#plot.slide(...this.#window);
  }

  close() {
    this.#plot.close();
    this.element.remove();
  }

  #look(axis, [line, mark]) {
    return {
      legend: { show: false },
      scales: { x: { time: false, range: () => this.#window } },
      axes: [
        { ...axis, size: 24, values: (_, splits) => splits.map((at) => `${at} s`) },
        { ...axis, size: (_, labels) => Math.max(56, ...(labels ?? []).map(widthOf)) },
      ],
      series: [{}, { stroke: line, width: 2, points: { show: false } }],
      hooks: { draw: [(drawn) => this.#drawMoment(drawn, mark)] },
    };
  }

  #drawMoment(drawn, colour) {
    const { ctx, bbox } = drawn;
    const x = drawn.valToPos(this.#atS, "x", true);
    ctx.save();
    ctx.strokeStyle = colour;
    ctx.lineWidth = 2 * devicePixelRatio;
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.restore();
  }
}

export class RecordedPlots {
  #parts;
  #address;
  #channels = [];
  #plots = [];
  #moment = [0, [0, 0]];

  /** @param {Record<string, HTMLElement>} parts @param {string} address of the recording */
  constructor(parts, address) {
    this.#parts = parts;
    this.#address = address;
    parts["plot-topic"].addEventListener("change", () => this.#offerFields());
    parts["plot-field"].addEventListener("change", ({ target }) => this.#add(target.value));
  }

  /** @param {object[]} channels of the recording */
  set channels(channels) {
    this.#channels = channels.filter(({ fields, messages }) => fields.length && messages);
    offer(this.#parts["plot-topic"], gettext("Topic"), topics(this.#channels));
    this.#offerFields();
  }

  show(atS, part) {
    this.#moment = [atS, part];
    for (const plot of this.#plots) this.#update(plot);
  }

  #offerFields() {
    const topic = this.#parts["plot-topic"].value;
    const fields = this.#channels.filter((one) => one.topic === topic).flatMap((one) => one.fields);
    offer(this.#parts["plot-field"], gettext("Field"), [...new Set(fields)]);
  }

  #add(field) {
    const { "plot-topic": topic, "plot-field": choice, plots, "plot-words": words } = this.#parts;
    choice.value = "";
    if (!field) return;
    const isFull = this.#plots.length >= PLOTS_AT_MOST;
    setTextOrHide(
      words,
      isFull ? interpolate(gettext("There are at most %s plots."), [PLOTS_AT_MOST]) : "",
    );
    if (isFull) return;
    const plot = new FieldOverTime(this.#address, topic.value, field, (one) => this.#remove(one));
    this.#plots.push(plot);
    plots.append(plot.element);
    this.#update(plot);
  }

  #remove(plot) {
    plot.close();
    this.#plots = this.#plots.filter((one) => one !== plot);
  }

  async #update(plot) {
    try {
      await plot.show(...this.#moment);
    } catch (error) {
      setTextOrHide(this.#parts["plot-words"], error.message);
    }
  }
}

/** Return the room (pixels) of a number beside its axis. */
function widthOf(label) {
  return 20 + 7 * (label?.length ?? 0);
}

function offer(select, name, values) {
  const first = make("option", { text: name });
  first.value = "";
  select.replaceChildren(first, ...values.map((text) => make("option", { text })));
}
