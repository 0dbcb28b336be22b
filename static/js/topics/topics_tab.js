/** The Topics tab: where input goes, what the robot says, what may be published, called and set. */

import { closable } from "../dialog.js";
import { mark, show } from "../dom.js";
import { SearchList } from "../list.js";
import { whyNot } from "../roles.js";
import { useLabel } from "../uses.js";
import { TopicsChannel } from "./channel.js";
import { FieldPlot, LINES_AT_MOST } from "./plot.js";
import { PublishPanel } from "./publish.js";
import { Repeater } from "./repeater.js";
import { ParameterView, ServiceCall } from "./services.js";
import { Watch } from "./watch.js";
import { Choices, candidates } from "./where.js";

const LOOK_HZ = 5;
const LOOKS_AT_MOST = 8;

/** What the robot publishes is asked for while the tab is shown, and not a moment longer. */
export class TopicsTab {
  #parts;
  #orders;
  #channel;
  #graph = { topics: [], actions: [], services: [] };
  #offers = { uses: {}, publishable: {}, from: {} };
  #choices;
  #publish;
  #repeater;
  #plot;
  #watches = new Map();
  #lists;
  #choosing = null; // the use for which another topic is being chosen
  #chosenDrive; // undefined: the default
  #role = "observer";
  #listening = new AbortController();
  #mayAct = false;

  /**
   * @param {Object<string, HTMLElement>} parts those of the tab, by data-part
   * @param {string} url of the WebSocket for topics
   * @param {{send: (order: object) => Promise<?object>}} orders sends an order, resolves with the refusal or null
   * @param {() => number} clock milliseconds, monotonic in this tab
   */
  constructor(parts, url, orders, clock) {
    this.#parts = parts;
    this.#orders = orders;
    this.#channel = new TopicsChannel(url);
    this.#choices = new Choices(parts.uses);
    this.#publish = new PublishPanel(parts, (topic, type) =>
      this.#channel.ask({ t: "describe", topic, type }),
    );
    this.#repeater = new Repeater((order) => this.#send({ ...order, sent_ms: clock() }));
    this.#plot = new FieldPlot(parts["topic-plot"]);
    this.#lists = this.#makeLists();
    this.#listen();
  }

  /** @param {object} offers of the robot */
  set offers({ uses = {}, publishable = {}, publishable_from: from = {} }) {
    this.#offers = { uses, publishable, from };
    this.#choices.uses = uses;
    this.#offerPublishing();
  }

  /** @param {object} state of the robot */
  set state({ chosen = {}, publishing = [] }) {
    this.#choices.chosen = chosen;
    if (chosen.drive !== this.#chosenDrive) {
      this.#chosenDrive = chosen.drive;
      this.#repeater.end();
      this.#offerPublishing();
    }
    this.#publish.running = [...publishing, ...this.#repeater.running];
  }

  /** @param {boolean} may this tab has control of the robot */
  set mayAct(may) {
    this.#mayAct = may;
    this.#choices.mayAct = may;
    this.#publish.mayAct = may;
    if (!may) this.#repeater.end();
  }

  /** @param {string} role of this person on the robot */
  set role(role) {
    this.#role = role;
    this.#offerPublishing();
  }

  /** No velocity is repeated any more. */
  zero() {
    this.#repeater.end();
  }

  show() {
    this.#channel.open();
  }

  hide() {
    this.#repeater.end();
    for (const topic of [...this.#watches.keys()]) this.#lookAway(topic);
    this.#channel.close();
  }

  close() {
    this.hide();
    this.#listening.abort();
    this.#publish.close();
    this.#plot.close();
    for (const list of Object.values(this.#lists)) list.close();
  }

  // --- wiring ----------------------------------------------------------------------------------

  #listen() {
    this.#channel.addEventListener("open", () => mark(this.#parts.watches, "stale", false));
    this.#channel.addEventListener("down", () => mark(this.#parts.watches, "stale", true));
    this.#channel.addEventListener("open", () => this.#refresh());
    this.#channel.addEventListener("open", () => this.#publish.connected());
    this.#channel.addEventListener("refused", ({ detail }) => this.#say(detail.text));
    this.#parts["topics-refresh"].addEventListener("click", () => this.#refresh());
    closable(this.#parts["choose-dialog"], this.#listening.signal);
    this.#choices.addEventListener("choose", ({ detail }) =>
      this.#choose(detail.use, detail.topic),
    );
    this.#choices.addEventListener("list", ({ detail }) => this.#offerTopics(detail.use));
    this.#publish.addEventListener("publish", ({ detail }) => this.#publishThis(detail));
    this.#publish.addEventListener("stop", ({ detail: { topic } }) => {
      if (this.#repeater.end(topic)) return;
      this.#send({ t: "publish_stop", topic });
    });
  }

  #makeLists() {
    return {
      topics: new SearchList(this.#parts["topic-list"], {
        label: gettext("Search topics"),
        text: ({ name, type }) => `${name} ${type}`,
        note: ({ type }) => type,
        act: (row) => this.#look(row),
      }),
      services: new SearchList(this.#parts["service-list"], {
        label: gettext("Search services"),
        text: ({ name }) => name,
        note: ({ node }) => node,
        act: ({ name }) =>
          this.#parts["service-call"].replaceChildren(
            new ServiceCall(this.#channel, name, this.#role === "staff").element,
          ),
      }),
      parameters: new SearchList(this.#parts["parameter-list"], {
        label: gettext("Search parameters"),
        text: ({ name }) => name,
        act: ({ name }) =>
          this.#parts["parameter-value"].replaceChildren(
            new ParameterView(this.#channel, name, this.#role === "staff").element,
          ),
      }),
      choices: new SearchList(this.#parts["choose-list"], {
        label: gettext("Search topics"),
        text: ({ name, type }) => `${name} ${type}`,
        note: ({ type, why }) => why || type,
        isOff: ({ why }) => why !== "",
        act: ({ name }) => {
          this.#parts["choose-dialog"].close();
          this.#choose(this.#choosing, name);
        },
      }),
    };
  }

  async #refresh() {
    try {
      const [graph, { names }] = await Promise.all([
        this.#channel.ask({ t: "topics" }),
        this.#channel.ask({ t: "parameters" }),
      ]);
      this.#graph = graph;
      this.#lists.topics.items = graph.topics;
      this.#lists.services.items = graph.services;
      this.#lists.parameters.items = names.map((name) => ({ name }));
      this.#say("");
    } catch (error) {
      this.#say(error.message);
    }
  }

  // --- where input goes ------------------------------------------------------------------------

  #offerTopics(use) {
    this.#choosing = use;
    this.#parts["choose-title"].textContent = interpolate(gettext("Where %s goes"), [
      useLabel(use),
    ]);
    this.#lists.choices.items = candidates(this.#graph, this.#offers.uses[use], this.#role);
    this.#parts["choose-dialog"].show();
    this.#lists.choices.focus();
  }

  #choose(use, topic) {
    this.#send({ t: "choose", use, topic: topic === this.#offers.uses[use].topic ? null : topic });
  }

  // --- looking ---------------------------------------------------------------------------------

  #look({ name, type }) {
    if (this.#watches.has(name)) {
      this.#watches.get(name).element.scrollIntoView({ block: "nearest" });
      return;
    }
    if (this.#watches.size >= LOOKS_AT_MOST) {
      this.#say(
        interpolate(gettext("At most %s topics at once: close one first."), [LOOKS_AT_MOST]),
      );
      return;
    }
    const watch = new Watch(name, type);
    watch.addEventListener("end", () => this.#lookAway(name));
    watch.addEventListener("plot", ({ detail }) => this.#replot(watch, detail));
    this.#watches.set(name, watch);
    this.#parts.watches.prepend(watch.element);
    this.#channel.look(name, LOOK_HZ, (message) => this.#shown(watch, message));
  }

  #lookAway(topic) {
    this.#channel.lookAway(topic);
    this.#watches.get(topic)?.element.remove();
    this.#watches.delete(topic);
    this.#plot.names = this.#plot.names.filter((name) => !name.startsWith(`${topic} `));
  }

  #shown(watch, message) {
    const isNew = message.number !== watch.number;
    watch.show(message);
    if (!isNew) return; // told once more, so that its figures are of now
    const numbers = watch.numbers(message);
    if (numbers.size) this.#plot.add(numbers);
  }

  #replot(watch, { path, on }) {
    const name = `${watch.topic} ${path}`;
    if (on && this.#plot.names.length >= LINES_AT_MOST) {
      watch.unplot(path);
      this.#say(interpolate(gettext("A plot has at most %s lines."), [LINES_AT_MOST]));
      return;
    }
    const others = this.#plot.names.filter((other) => other !== name);
    this.#plot.names = on ? [...others, name] : others;
  }

  // --- publishing ------------------------------------------------------------------------------

  #offerPublishing() {
    const { publishable, from } = this.#offers;
    const offered = Object.entries(publishable).map(([topic, type]) => {
      return { topic, type, why: from[topic] ? whyNot(this.#role, from[topic]) : "" };
    });
    const drive = Object.entries(this.#velocities).map(([topic, type]) => ({
      topic,
      type,
      why: "",
    }));
    this.#publish.publishable = [...offered, ...drive];
  }

  /** The one topic to which velocities go, with their type. */
  get #velocities() {
    const { drive } = this.#offers.uses;
    return drive ? { [this.#chosenDrive ?? drive.topic]: drive.type } : {};
  }

  /** A velocity is valid for a third of a second: this page repeats it, and stops with the page. */
  #publishThis(order) {
    const message = { t: "publish", ...order };
    if (!(order.topic in this.#velocities)) this.#send(message);
    else if (order.rate_hz) this.#repeater.begin({ ...message, rate_hz: 0 }, order.rate_hz);
    else this.#repeater.once({ ...message, rate_hz: 0 });
  }

  async #send(order) {
    if (!this.#mayAct) return;
    const refusal = await this.#orders.send(order);
    if (!refusal) return;
    if (order.t === "publish") {
      this.#repeater.end(order.topic);
      this.#publish.fault(refusal);
    }
  }

  #say(text) {
    this.#parts["topics-fault"].textContent = text;
    show(this.#parts["topics-fault"], text !== "");
  }
}
