/** A plot beside the other pictures of a layout: fields of one topic over time. The person chooses them in it. */

import { NEW_PLOT } from "../control/layout/cells.js";
import { make, mark, parts, setTextOrHide } from "../lib/dom.js";
import { rows } from "./fields.js";
import { FieldPlot } from "./plot.js";

const ALL = { has: () => true }; // a list's elements are fields, too

/** Event: "choose": the person chose another topic or other fields. */
export class PlotCell extends EventTarget {
  #element;
  #parts;
  #plot;
  #topic = "";
  #number = null; // of the newest message
  #offered = null; // fields in the list
  #refused = ""; // why the last choice was not possible

  /** @param {HTMLElement} element a copy of the template @param {string} content its topic and fields */
  constructor(element, content) {
    super();
    this.#element = element;
    this.#parts = parts(element);
    this.#plot = new FieldPlot(this.#parts["plot-lines"]);
    const { "plot-topic": topic, "plot-field": field, "plot-clear": clear } = this.#parts;
    topic.addEventListener("change", () => this.#choose(topic, topic.value, []));
    field.addEventListener("change", () =>
      this.#choose(field, this.#topic, [...this.#plot.names, field.value]),
    );
    clear.addEventListener("click", () => this.#choose(clear, this.#topic, []));
    const [, name = "", ...fields] = content.split(" ");
    this.#topic = name;
    this.topics = [];
    this.#offerFields({});
    this.#begin(name, fields);
  }

  /** The content of its cell: see `cells.js`. */
  get content() {
    return [NEW_PLOT, this.#topic, ...this.#plot.names].filter(Boolean).join(" ");
  }

  get topic() {
    return this.#topic;
  }

  /** @param {string[]} names of the robot's topics */
  set topics(names) {
    const all = this.#topic && !names.includes(this.#topic) ? [this.#topic, ...names] : names;
    fillOptions(this.#parts["plot-topic"], gettext("Topic"), all, this.#topic);
    this.say("");
  }

  /** @param {string} cell its name */
  set cell(cell) {
    mark(this.#element, "cell", cell);
  }

  /** @param {boolean} stale the topic is as old as the robot's view */
  set stale(stale) {
    mark(this.#element, "old", stale);
  }

  /** @param {object} sample of its topic */
  take({ fields, number, refusal }) {
    this.#offerFields(fields ?? {});
    this.say(refusal?.text ?? "");
    this.#plot.add(number === this.#number ? null : (fields ?? null));
    this.#number = number;
  }

  /** @param {string} text of the connection; empty: say what the person has to choose next, if anything */
  say(text) {
    setTextOrHide(this.#parts["plot-words"], text || this.#refused || this.#asked());
  }

  close() {
    this.#plot.close();
    this.#element.remove();
  }

  #choose(input, topic, fields) {
    this.#begin(topic, fields);
    input.blur(); // so that keys drive again
    this.dispatchEvent(new CustomEvent("choose"));
  }

  #begin(topic, fields) {
    if (topic !== this.#topic) {
      this.#topic = topic;
      this.#parts["plot-topic"].value = topic;
      this.#offerFields({});
    }
    for (const name of this.#plot.names) if (!fields.includes(name)) this.#plot.put(name, false);
    this.#refused = fields.map((field) => this.#plot.put(field, true)).find(Boolean) ?? "";
    this.#parts["plot-field"].value = "";
    this.say("");
  }

  #offerFields(fields) {
    const found = rows(fields, ALL).filter(({ kind }) => kind === "number");
    const paths = found.map(({ path }) => path);
    if (String(paths) === this.#offered) return; // an open list stays open
    this.#offered = String(paths);
    fillOptions(this.#parts["plot-field"], gettext("Add a field"), paths, "");
  }

  #asked() {
    if (!this.#topic) return gettext("Choose a topic, then its fields.");
    if (this.#plot.names.length > 0) return "";
    return this.#offered
      ? gettext("Choose the fields of this topic.")
      : gettext("No message of this topic with a number has come yet.");
  }
}

function fillOptions(select, title, values, chosen) {
  const options = values.map((value) => Object.assign(make("option", { text: value }), { value }));
  const first = Object.assign(make("option", { text: title }), { value: "", disabled: true });
  select.replaceChildren(first, ...options);
  select.value = chosen;
}
