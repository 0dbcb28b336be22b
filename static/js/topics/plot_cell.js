/** A plot beside the other pictures of a layout: fields of one topic over time. Kept for each account and robot. */

import { socketUrl } from "../connection/socket.js";
import { make, mark, setTextOrHide, show } from "../lib/dom.js";
import { TopicsChannel } from "./channel.js";
import { rows } from "./fields.js";
import { FieldPlot } from "./plot.js";

const RATE_HZ = 5;
const ALL = { has: () => true }; // a list's elements are fields, too

export class PlotCell {
  static hears = ["plotShown", "stale"];
  #parts;
  #choices;
  #robot;
  #channel;
  #plot;
  #topic = ""; // that is plotted
  #number = null; // of its newest message
  #offered = ""; // fields in the list
  #isShown = false;
  #listening = new AbortController();

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ root, parts, choices }) {
    this.#parts = parts;
    this.#choices = choices;
    this.#robot = root.dataset.robot;
    this.#plot = new FieldPlot(parts["plot-lines"]);
    this.#channel = new TopicsChannel(socketUrl(root.dataset.topics));
    const { signal } = this.#listening;
    const on = (target, type, act) => target.addEventListener(type, act, { signal });
    on(this.#channel, "open", () => this.#offerTopics());
    on(this.#channel, "refused", ({ detail }) => this.#say(detail.text));
    on(parts["plot-topic"], "change", ({ target }) => this.#choose(target, [target.value]));
    on(parts["plot-field"], "change", ({ target }) =>
      this.#choose(target, [this.#topic, ...this.#plot.names, target.value]),
    );
    on(parts["plot-clear"], "click", ({ target }) => this.#choose(target, [this.#topic]));
    this.#begin(choices.recall(this.#key, {}).plot ?? "");
  }

  /** @param {boolean} shown whether a cell of the layout shows the plot: only then the topic is read */
  set plotShown(shown) {
    if (shown === this.#isShown) return;
    this.#isShown = shown;
    show(this.#parts.plot, shown);
    if (shown) this.#channel.open();
    else this.#channel.close();
  }

  /** Whether the robot's view is out of date: then the topic is, too. */
  set stale(stale) {
    mark(this.#parts.plot, "old", stale);
  }

  close() {
    this.#listening.abort();
    this.#channel.close();
    this.#plot.close();
  }

  get #key() {
    return `plot ${this.#robot}`;
  }

  #choose(input, words) {
    const plot = words.join(" ");
    this.#choices.remember(this.#key, { robot: this.#robot, plot });
    this.#begin(plot);
    input.blur(); // so that keys drive again
  }

  /** @param {string} plot topic and fields, separated by spaces; empty: nothing is plotted */
  #begin(plot) {
    const [topic, ...fields] = plot.split(" ");
    if (topic !== this.#topic) {
      if (this.#topic) this.#channel.unsubscribe(this.#topic);
      if (topic) this.#channel.subscribe(topic, RATE_HZ, (sample) => this.#take(sample));
      this.#topic = topic;
      this.#offerFields({});
    }
    for (const name of this.#plot.names) if (!fields.includes(name)) this.#plot.put(name, false);
    const refused = fields.map((field) => this.#plot.put(field, true)).find(Boolean);
    this.#say(refused ?? this.#asked());
  }

  async #offerTopics() {
    this.#say(gettext("Asking the robot…"));
    try {
      const { topics } = await this.#channel.ask({ t: "topics" });
      const names = topics.map(({ name }) => name);
      const all = this.#topic && !names.includes(this.#topic) ? [this.#topic, ...names] : names;
      fillOptions(this.#parts["plot-topic"], gettext("Topic"), all, this.#topic);
      this.#say(this.#asked());
    } catch (error) {
      if (!this.#listening.signal.aborted) this.#say(error.message);
    }
  }

  #take({ fields, number, refusal }) {
    this.#say(refusal?.text ?? this.#asked());
    this.#offerFields(fields ?? {});
    this.#plot.add(number === this.#number ? null : (fields ?? null));
    this.#number = number;
  }

  #offerFields(fields) {
    const found = rows(fields, ALL).filter(({ kind }) => kind === "number");
    const paths = found.map(({ path }) => path);
    if (String(paths) === this.#offered) return; // an open list stays open
    this.#offered = String(paths);
    fillOptions(this.#parts["plot-field"], gettext("Add a field"), paths, "");
  }

  /** What the person has to choose next; empty: nothing. */
  #asked() {
    if (!this.#topic) return gettext("Choose a topic, then its fields.");
    return this.#plot.names.length === 0 ? gettext("Choose the fields of this topic.") : "";
  }

  #say(text) {
    setTextOrHide(this.#parts["plot-words"], text);
  }
}

function fillOptions(select, title, values, chosen) {
  const options = values.map((value) => Object.assign(make("option", { text: value }), { value }));
  const first = Object.assign(make("option", { text: title }), { value: "", disabled: true });
  select.replaceChildren(first, ...options);
  select.value = chosen;
}
