/** The Topics tab: topics for input, the robot's messages, publishing, services and parameters. */

import { socketUrl } from "../connection/socket.js";
import { isAtLeast, whyNot } from "../control/roles.js";
import { closable } from "../lib/dialog.js";
import { setTextOrHide, show } from "../lib/dom.js";
import { SearchList } from "../lib/list.js";
import { NewEnds } from "../tasks/task_ends.js";
import { useLabel } from "../tasks/uses.js";
import { TopicsChannel } from "./channel.js";
import { typeText } from "./fields.js";
import { candidates, InputChoice } from "./input_choice.js";
import { PublishPanel } from "./publish.js";
import { Repeater } from "./repeater.js";
import { ParameterView, ServiceCall } from "./services.js";
import { TopicView } from "./topic_view.js";

const RATE_HZ = 5;
const MOST_SUBSCRIPTIONS = 8;
const AGAIN_MS = 3000; // until a request without answer is sent again: the robot may be back by then
// Refusals that do not change if the request is repeated.
const NOT_RETRIED = new Set(["too_large", "inspector_fault", "not_connected"]);

/** Text for the end of publishing on a topic. */
function publishedNoMore(topic) {
  return interpolate(gettext("Publishing on %s has ended."), [topic]);
}

/** Requests the robot's topics only while the tab is shown. */
export class TopicsTab {
  static hears = ["role", "offers", "state", "state.choice_ended", "mayAct", "tab"];
  static requests = {
    choose: {
      name: ({ use }) => interpolate(gettext("Change where %s goes"), [useLabel(use)]),
      done: ({ use, topic }) =>
        interpolate(
          topic
            ? gettext("%(use)s goes to %(topic)s now.")
            : gettext("%(use)s goes to its default again."),
          { use: useLabel(use), topic },
          true,
        ),
    },
    publish: {
      name: ({ topic }) => interpolate(gettext("Publish on %s"), [topic]),
      done: ({ topic }) => interpolate(gettext("Published on %s."), [topic]),
    },
    publish_stop: {
      name: ({ topic }) => interpolate(gettext("Stop publishing on %s"), [topic]),
      done: ({ topic }) => publishedNoMore(topic),
      ends: true,
    },
  };
  #parts;
  #request;
  #notifyPage;
  #channel;
  #graph = { topics: [], actions: [], services: [] };
  #offers = { uses: {}, publishable: {}, from: {} };
  #choices;
  #choiceEnds;
  #publish;
  #repeater;
  #watches = new Map();
  #lists;
  #choosing = null; // the use for which another topic is being chosen
  #chosen = {}; // by use, where it is not the default
  #role = "observer";
  #mayAct = null;
  #listening = new AbortController();
  #isShown = false;
  #again = null; // timer of a refresh that is repeated; set until the repeated refresh has ended

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ root, parts, request, notify, clock }) {
    this.#parts = parts;
    this.#request = request;
    this.#notifyPage = notify;
    this.#channel = new TopicsChannel(socketUrl(root.dataset.topics));
    this.#choices = new InputChoice(parts.uses);
    this.#choiceEnds = new NewEnds(({ text }) =>
      notify({ level: "warning", code: "choice ended", text }),
    );
    this.#publish = new PublishPanel(parts, (topic, type) =>
      this.#channel.ask({ t: "describe", topic, type }),
    );
    this.#repeater = new Repeater((request) => this.#send({ ...request, sent_ms: clock() }));
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
    const before = this.#chosen;
    this.#choices.chosen = this.#chosen = chosen;
    if (chosen.drive !== before.drive) {
      this.#repeater.end();
      this.#offerPublishing();
    }
    this.#publish.running = [...publishing, ...this.#repeater.running];
  }

  /** @param {Object<string, object>} ends of choices, by use */
  set choice_ended(ends) {
    this.#choiceEnds.follow(ends);
  }

  /** @param {?boolean} may whether this tab has control of the robot; null: not known yet */
  set mayAct(may) {
    this.#mayAct = may;
    this.#choices.mayAct = may;
    show(this.#parts["uses-control"], may === false);
    this.#publish.mayAct = may;
    if (may) return;
    this.#repeater.end();
    this.#parts["choose-dialog"].close();
  }

  /** @param {string} role of this person on the robot */
  set role(role) {
    this.#role = role;
    this.#offerPublishing();
  }

  /** @param {string} tab that is shown */
  set tab(tab) {
    if (tab === "topics") this.show();
    else if (this.#isShown) this.hide();
  }

  /** Stop repeating velocities. */
  zero() {
    this.#repeater.end();
  }

  show() {
    this.#isShown = true;
    this.#sayEmpty(gettext("Asking the robot…"));
    this.#channel.open();
  }

  hide() {
    this.#isShown = false;
    this.#endAgain();
    this.#repeater.end();
    this.#parts["choose-dialog"].close();
    this.#channel.close();
  }

  close() {
    this.hide();
    for (const topic of [...this.#watches.keys()]) this.#unsubscribe(topic);
    this.#listening.abort();
    this.#publish.close();
    for (const list of Object.values(this.#lists)) list.close();
  }

  // --- wiring ----------------------------------------------------------------------------------

  #listen() {
    this.#channel.addEventListener("open", () => this.#refresh());
    this.#channel.addEventListener("open", () => this.#publish.connected());
    this.#channel.addEventListener("late", () => this.#late());
    this.#channel.addEventListener("refused", ({ detail }) => this.#showText(detail.text));
    this.#parts["topics-refresh"].addEventListener("click", () => {
      this.#endAgain();
      this.#refresh();
    });
    closable(this.#parts["choose-dialog"], this.#listening.signal);
    this.#choices.addEventListener("choose", ({ detail }) =>
      this.#choose(detail.use, detail.topic),
    );
    this.#choices.addEventListener("list", ({ detail }) => this.#openChoice(detail.use));
    this.#publish.addEventListener("publish", ({ detail }) => this.#publishThis(detail));
    this.#publish.addEventListener("stop", ({ detail: { topic } }) => {
      if (!this.#repeater.end(topic)) this.#send({ t: "publish_stop", topic });
      else this.#notify("success", publishedNoMore(topic));
    });
  }

  #makeLists() {
    return {
      topics: new SearchList(this.#parts["topic-list"], {
        label: gettext("Search topics"),
        text: ({ name, type }) => `${name} ${type}`,
        note: ({ type }) => typeText(type),
        act: (row) => this.#subscribe(row),
      }),
      services: new SearchList(this.#parts["service-list"], {
        label: gettext("Search services"),
        text: ({ name }) => name,
        note: ({ node }) => node,
        act: ({ name }) =>
          this.#parts["service-call"].replaceChildren(
            new ServiceCall(this.#channel, name, isAtLeast(this.#role, "staff")).element,
          ),
      }),
      parameters: new SearchList(this.#parts["parameter-list"], {
        label: gettext("Search parameters"),
        text: ({ name }) => name,
        act: ({ name }) =>
          this.#parts["parameter-value"].replaceChildren(
            new ParameterView(this.#channel, name, isAtLeast(this.#role, "staff")).element,
          ),
      }),
      choices: new SearchList(this.#parts["choose-list"], {
        label: gettext("Search topics"),
        text: ({ name, type }) => `${name} ${type}`,
        note: ({ type, mark, why }) => [typeText(type), mark, why].filter(Boolean).join(" · "),
        isOff: ({ why }) => why !== "",
        act: ({ name }) => {
          this.#parts["choose-dialog"].close();
          this.#choose(this.#choosing, name);
        },
      }),
    };
  }

  /** Report a late answer to a person's request, but not to an automatic repetition. */
  #late() {
    if (this.#again !== null) return;
    this.#notify("info", gettext("Topics: no answer within 0.75 s yet. It may take some seconds."));
  }

  async #refresh() {
    this.#sayEmpty(gettext("Asking the robot…"));
    const asked = [this.#readGraph(), this.#readParameters()];
    const { reason } = (await Promise.allSettled(asked)).find((answer) => answer.reason) ?? {};
    if (!this.#isShown) return;
    this.#showText(reason?.message ?? "");
    this.#endAgain();
    if (reason && !NOT_RETRIED.has(reason.refusal?.code)) {
      this.#again = setTimeout(() => this.#refresh(), AGAIN_MS);
    } else {
      this.#sayEmpty(
        reason ? gettext("No answer. The reason is at the top.") : gettext("The robot has none."),
      );
    }
  }

  #endAgain() {
    clearTimeout(this.#again);
    this.#again = null;
  }

  /** The text of an empty list. */
  #sayEmpty(text) {
    for (const list of Object.values(this.#lists)) list.empty = text;
  }

  async #readGraph() {
    this.#graph = await this.#channel.ask({ t: "topics" });
    this.#lists.topics.items = this.#graph.topics;
    this.#lists.services.items = this.#graph.services;
    if (this.#choosing) this.#offerTopics();
  }

  async #readParameters() {
    const { names } = await this.#channel.ask({ t: "parameters" });
    this.#lists.parameters.items = names.map((name) => ({ name }));
  }

  // --- where input goes ------------------------------------------------------------------------

  #openChoice(use) {
    if (!this.#mayAct) return this.#warn(gettext("Take control first."));
    this.#choosing = use;
    this.#parts["choose-title"].textContent = interpolate(gettext("Where %s goes"), [
      useLabel(use),
    ]);
    this.#lists.choices.clear();
    this.#offerTopics();
    this.#parts["choose-dialog"].show();
    this.#lists.choices.focus();
    this.#refresh(); // the robot may have other topics by now
  }

  #offerTopics() {
    const use = this.#choosing;
    const offer = this.#offers.uses[use];
    const { choices } = this.#lists;
    const begins = choices.items.length === 0;
    choices.items = candidates(this.#graph, offer, this.#role, this.#chosen[use]);
    if (begins) choices.focus(); // the search field was hidden when the dialog opened
  }

  #choose(use, topic) {
    this.#send({ t: "choose", use, topic: topic === this.#offers.uses[use].topic ? null : topic });
  }

  // --- subscribing -----------------------------------------------------------------------------

  #subscribe({ name, type }) {
    if (this.#watches.has(name)) {
      this.#watches.get(name).element.scrollIntoView({ block: "nearest" });
      return;
    }
    if (this.#watches.size >= MOST_SUBSCRIPTIONS) {
      this.#warn(
        interpolate(gettext("At most %s topics at once: close one first."), [MOST_SUBSCRIPTIONS]),
      );
      return;
    }
    const watch = new TopicView(name, type);
    watch.addEventListener("end", () => this.#unsubscribe(name));
    watch.addEventListener("refused", ({ detail }) => this.#warn(detail));
    this.#watches.set(name, watch);
    this.#parts.watches.prepend(watch.element);
    show(this.#parts["watch-none"], false);
    this.#channel.subscribe(name, RATE_HZ, (message) => watch.show(message));
  }

  #unsubscribe(topic) {
    this.#channel.unsubscribe(topic);
    this.#watches.get(topic)?.close();
    this.#watches.delete(topic);
    show(this.#parts["watch-none"], this.#watches.size === 0);
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

  /** The topic to which velocities go, with its type; empty if there is none. */
  get #velocities() {
    const { drive } = this.#offers.uses;
    return drive ? { [this.#chosen.drive ?? drive.topic]: drive.type } : {};
  }

  /** A velocity is valid for a third of a second: this page repeats it, so the robot stops with the page. */
  #publishThis(request) {
    const message = { t: "publish", ...request };
    if (!(request.topic in this.#velocities)) this.#send(message);
    else if (request.rate_hz) this.#repeater.begin({ ...message, rate_hz: 0 }, request.rate_hz);
    else this.#repeater.once({ ...message, rate_hz: 0 });
  }

  async #send(request) {
    const refusal = await this.#request(request);
    if (!refusal) return;
    if (request.t === "publish") {
      this.#repeater.end(request.topic);
      this.#publish.fault(refusal);
    }
  }

  #warn(text) {
    this.#notify("warning", text);
  }

  #notify(level, text) {
    this.#notifyPage({ level, code: text, text });
  }

  #showText(text) {
    setTextOrHide(this.#parts["topics-fault"], text);
  }
}
