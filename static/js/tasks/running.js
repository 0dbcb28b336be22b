/**
 * The running tasks, on every tab, each with Cancel; and the uses of the tab that go to another topic than the
 * default.
 */

import { make, makeButton, setText, show } from "../lib/dom.js";
import { useLabel, usesOf } from "./uses.js";

/** One kind of task: words, the person, a line that its panel may have, and Cancel. */
class Row {
  element;
  #panel;
  #words = make("strong");
  #who = make("span", { className: "quiet" });
  #cancel;
  #requests = [];

  constructor(task, panel, send) {
    this.#panel = panel;
    this.#cancel = makeButton({ className: "button", text: gettext("Cancel") }, () => {
      for (const request of this.#requests) send(request);
    });
    const words = make("p", { className: "runs-words", children: [this.#words, " ", this.#who] });
    if (panel.line) words.setAttribute("role", "status");
    const children = [words, panel.line?.element, this.#cancel].filter(Boolean);
    this.element = make("div", { className: "runs", children });
    this.element.hidden = true;
    const parts = { runs: this.element, words: this.#words, who: this.#who, cancel: this.#cancel };
    for (const [name, part] of Object.entries(parts)) part.dataset.part = `${task}-${name}`;
  }

  /** @param {any} task as `PageState` tells it */
  set task(task) {
    const shown = this.#panel.shows(task);
    show(this.element, Boolean(shown));
    if (!shown) return;
    this.#requests = shown.cancel;
    setText(this.#words, shown.words);
    setText(this.#who, interpolate(gettext("for %s"), [shown.who]));
    this.#panel.line?.show(task);
  }

  /**
   * @param {(t: string) => boolean} may whether this person may send a kind of request
   * @param {(request: object) => string} nameOf
   */
  offerCancel(may, nameOf) {
    if (this.element.hidden) return;
    const [request] = this.#requests;
    show(this.#cancel, may(request.t));
    this.#cancel.setAttribute("aria-label", nameOf(request));
  }
}

export class Running {
  #parts;
  #send;
  #kinds;
  #rows = [];
  #chosen = {}; // topics by use, where they are not the default
  #tab = null;
  #mayAct = null;
  #mayCancel = false;
  #offers = false;

  /**
   * @param {Record<string, HTMLElement>} parts
   * @param {(request: object) => void} send
   * @param {Object<string, import("./tasks.js").RequestKind>} kinds of requests, by their `t`
   */
  constructor(parts, send, kinds) {
    this.#parts = parts;
    this.#send = send;
    this.#kinds = kinds;
  }

  /**
   * Add a row for a kind of task.
   * @param {string} task field of the robot's state
   * @param {object} panel `shows(task)` returns `{words, who, cancel}`, with the requests that cancel the task;
   *   null: nothing runs. `line`: `{element, show(task)}`, for a line below the words, which are then announced
   * @returns {(task: any) => void} takes the newest state of the task
   */
  row(task, panel) {
    const row = new Row(task, panel, this.#send);
    this.#rows.push(row);
    this.#parts.elsewhere.before(row.element);
    return (newest) => {
      row.task = newest;
      this.#show();
    };
  }

  /** @param {Object<string, string>} chosen topics by use, where they are not the default */
  set chosen(chosen) {
    this.#chosen = chosen;
    this.#show();
  }

  /** @param {?object} ghost of the robot where a person pressed: its buttons are beside the running tasks */
  set ghost(ghost) {
    this.#offers = ghost !== null;
    this.#show();
  }

  /** @param {boolean} may whether this person may cancel what supervisors may cancel without control */
  set mayCancel(may) {
    this.#mayCancel = may;
    this.#show();
  }

  /** @param {string} tab that is shown: its chosen topics are shown with it */
  set tab(tab) {
    this.#tab = tab;
    this.#show();
  }

  /** @param {?boolean} may whether this tab has control; null: not known yet */
  set mayAct(may) {
    this.#mayAct = may;
    this.#show();
  }

  #show() {
    const may = (t) =>
      this.#kinds[t].control === "optional" ? this.#mayCancel : this.#mayAct === true;
    const nameOf = (request) => this.#kinds[request.t].name(request);
    for (const row of this.#rows) row.offerCancel(may, nameOf);
    const uses = usesOf(this.#tab).filter((use) => use in this.#chosen);
    const shown = JSON.stringify([uses.map((use) => [use, this.#chosen[use]]), this.#mayAct]);
    if (this.#parts.elsewhere.dataset.shown !== shown) {
      this.#parts.elsewhere.dataset.shown = shown;
      this.#parts.elsewhere.replaceChildren(...uses.map((use) => this.#elsewhere(use)));
    }
    const isAny = this.#rows.some(({ element }) => !element.hidden) || uses.length > 0;
    show(this.#parts.running, isAny || this.#offers);
  }

  #elsewhere(use) {
    const goes = interpolate(
      gettext("%(use)s goes to %(topic)s"),
      { use: useLabel(use), topic: this.#chosen[use] },
      true,
    );
    const words = make("p", { className: "runs-words", text: goes });
    const row = make("div", { className: "runs", children: [words] });
    if (!this.#mayAct) return row;
    const back = makeButton({ className: "button", text: gettext("Default") }, () =>
      this.#send({ t: "choose", use, topic: null }),
    );
    back.setAttribute("aria-label", `${useLabel(use)}: ${gettext("Back to the default")}`);
    row.append(back);
    return row;
  }
}
