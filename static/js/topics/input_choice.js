/** The topics to which input goes: for each use its topic, a way back to the default, and other choices. */

import { whyNotNow } from "../control/lease.js";
import { whyNot } from "../control/roles.js";
import { dim, make, makeButton, setText, setTextOrHide, show } from "../lib/dom.js";
import { USES, useLabel } from "../tasks/uses.js";

/**
 * Return all topics (or actions) for a use. Those that fit and are allowed come first. Pure.
 * @param {object} graph of the robot @param {{topic, type, chooseable}} offer
 * @param {string} role of this person on the robot
 * @param {string} [chosen] the current topic, if it is not the default
 * @returns {{name: string, type: string, mark: string, why: string}[]} `why`: the reason why it
 *   cannot be chosen, empty if it can
 */
export function candidates(graph, offer, role, chosen) {
  const isAction = offer.type.endsWith("Action");
  const found = (isAction ? graph.actions : graph.topics).map(({ name, type }) => ({
    name,
    type,
    mark: name === offer.topic ? gettext("default") : name === chosen ? gettext("chosen") : "",
    why: why(name, type, offer, role),
  }));
  const rank = ({ name, type, why: not }) =>
    name === offer.topic ? 0 : not === "" ? 1 : type === offer.type ? 2 : 3;
  return found.sort((a, b) => rank(a) - rank(b) || a.name.localeCompare(b.name));
}

function why(name, type, offer, role) {
  if (type !== offer.type) return gettext("wrong type");
  if (name === offer.topic) return "";
  const needed = offer.chooseable[name];
  return needed ? whyNot(role, needed) : gettext("not on the allow-list");
}

/**
 * One row for each use that the robot has. Event "choose": {use, topic}, topic null for the default; "list":
 * {use}.
 */
export class InputChoice extends EventTarget {
  #list;
  #rows = new Map();
  #offers = {};
  #chosen = {};
  #mayAct = false;

  /** @param {HTMLElement} list */
  constructor(list) {
    super();
    this.#list = list;
  }

  /** @param {Object<string, {topic, type}>} uses */
  set uses(uses) {
    this.#offers = uses;
    this.#rows = new Map(USES.filter((use) => use in uses).map((use) => [use, this.#row(use)]));
    this.#list.replaceChildren(...[...this.#rows.values()].map(({ item }) => item));
    this.#show();
  }

  /** @param {Object<string, string>} chosen by use, where it is not the default */
  set chosen(chosen) {
    this.#chosen = chosen;
    this.#show();
  }

  /** @param {boolean} may whether this tab has control */
  set mayAct(may) {
    this.#mayAct = may;
    this.#show();
  }

  #row(use) {
    const topic = make("code");
    const note = make("span", { className: "badge" });
    const back = this.#button(gettext("Back to the default"), "choose", { use, topic: null });
    const change = this.#button(gettext("Change…"), "list", { use });
    const why = make("p", { className: "quiet" });
    const goes = make("p", { children: [topic, " ", note] });
    const words = make("div", { children: [make("h3", { text: useLabel(use) }), goes, why] });
    const item = make("li", { className: "use", children: [words, back, change] });
    return { item, topic, note, why, back, change };
  }

  #button(text, event, detail) {
    return makeButton({ className: "button", text }, () =>
      this.dispatchEvent(new CustomEvent(event, { detail })),
    );
  }

  #show() {
    for (const [use, { item, topic, note, why, back, change }] of this.#rows) {
      const chosen = this.#chosen[use];
      setText(topic, chosen ?? this.#offers[use].topic);
      setText(note, chosen ? gettext("chosen") : gettext("default"));
      item.dataset.chosen = Boolean(chosen);
      show(back, Boolean(chosen));
      setTextOrHide(why, this.#offers[use].refusal?.text ?? "");
      for (const button of [back, change]) dim(button, !this.#mayAct, whyNotNow());
    }
  }
}
