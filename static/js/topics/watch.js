/** A topic that is looked at: its figures, its newest message field by field, numbers to plot. */

import { make, say, show } from "../dom.js";
import { figuresText, isNumeric, numberAt, rows, valueText, wholeLengths } from "./fields.js";

/** Events: "plot" {path, on}, "end". */
export class Watch extends EventTarget {
  element;
  topic;
  number = null; // of the newest message
  #type;
  #figures;
  #problem;
  #table;
  #rows = new Map();
  #plotted = new Set();

  /** @param {string} topic @param {string} type as the robot's master knows it */
  constructor(topic, type) {
    super();
    this.topic = topic;
    this.#type = make("span", { className: "quiet", text: type });
    this.#figures = make("p", { className: "quiet", text: gettext("Waiting for a message.") });
    this.#problem = make("p", { className: "why" });
    this.#problem.hidden = true;
    this.#table = make("dl", { className: "told" });
    const end = make("button", { className: "button", text: gettext("Close") });
    end.type = "button";
    end.addEventListener("click", () => this.dispatchEvent(new CustomEvent("end")));
    const title = make("h3", { children: [make("code", { text: topic }), " ", this.#type] });
    const head = make("header", { children: [title, end] });
    this.element = make("article", {
      className: "watch",
      children: [head, this.#figures, this.#problem, this.#table],
    });
    this.element.setAttribute("aria-label", topic);
  }

  /** @param {object} message as in `shown` */
  show(message) {
    this.number = message.number;
    say(this.#type, message.type);
    say(this.#figures, figuresText(message));
    say(this.#problem, message.refusal?.text ?? "");
    show(this.#problem, Boolean(message.refusal));
    const lengths = wholeLengths(message.shortened ?? []);
    const found = rows(message.fields);
    if (found.length !== this.#rows.size || found.some(({ path }) => !this.#rows.has(path))) {
      this.#rebuild(found);
    }
    for (const { path, value, leaf } of found) {
      if (leaf) say(this.#rows.get(path), valueText(value, lengths.get(path) ?? null));
    }
  }

  /** @param {object} message @returns {Map<string, ?number>} of the fields that are plotted, by "topic path" */
  numbers({ fields }) {
    return new Map(
      [...this.#plotted].map((path) => [`${this.topic} ${path}`, numberAt(fields, path)]),
    );
  }

  /** Takes the mark off a field that is plotted no more. */
  unplot(path) {
    this.#plotted.delete(path);
    for (const button of this.#table.querySelectorAll("button")) {
      if (button.dataset.path === path) button.setAttribute("aria-pressed", "false");
    }
  }

  #rebuild(found) {
    this.#rows.clear();
    this.#table.replaceChildren(
      ...found.map(({ path, value, depth, leaf }) => {
        const name = make("dt", { text: path.slice(path.lastIndexOf(".") + 1) });
        const shown = make("span");
        const cell = make("dd", { children: [shown] });
        this.#rows.set(path, shown);
        if (leaf && isNumeric(value)) cell.append(this.#plotButton(path));
        return make("div", { data: { depth: Math.min(depth, 6) }, children: [name, cell] });
      }),
    );
  }

  #plotButton(path) {
    const button = make("button", {
      className: "toggle small",
      text: gettext("Plot"),
      data: { path },
    });
    button.type = "button";
    button.setAttribute("aria-pressed", String(this.#plotted.has(path)));
    button.setAttribute("aria-label", interpolate(gettext("Plot %s"), [path]));
    button.addEventListener("click", () => {
      const on = !this.#plotted.has(path);
      if (on) this.#plotted.add(path);
      else this.#plotted.delete(path);
      button.setAttribute("aria-pressed", String(on));
      this.dispatchEvent(new CustomEvent("plot", { detail: { path, on } }));
    });
    return button;
  }
}
