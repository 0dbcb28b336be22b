/** View of a topic: its figures, its newest message field by field, numbers over time. */

import { make, makeButton, mark, setText, setTextOrHide, show } from "../lib/dom.js";
import { figuresText, PATHS_AT_MOST, rows, typeText, valueText } from "./fields.js";
import { FieldPlot } from "./plot.js";

const SILENCE_MS = 4000; // a subscribed topic is reported every second, also without messages

/** Events: "refused" (detail: a text), "end". */
export class TopicView extends EventTarget {
  element;
  #type;
  #figures = make("p", { className: "quiet", text: gettext("Waiting for a message.") });
  #problem = make("p", { className: "why" });
  #table = make("dl", { className: "field-list" });
  #cut = make("p", { className: "quiet" });
  #plot;
  #rows = new Map(); // by path and kind
  #opened = new Set(); // paths of lists whose elements have rows of their own
  #number = null; // of the newest message
  #fields = {};
  #lengths = new Map(); // full lengths, by path, of lists that are shown in part
  #silence = null;

  /** @param {string} topic @param {string} type as the robot's master reports it */
  constructor(topic, type) {
    super();
    this.#type = make("span", { className: "quiet", text: typeText(type) });
    this.#problem.hidden = this.#cut.hidden = true;
    this.#cut.textContent = interpolate(gettext("Only the first %s fields are shown."), [
      PATHS_AT_MOST,
    ]);
    const end = makeButton({ className: "button", text: gettext("Close") }, () =>
      this.dispatchEvent(new CustomEvent("end")),
    );
    const title = make("h3", { children: [make("code", { text: topic }), " ", this.#type] });
    const head = make("header", { children: [title, end] });
    const plot = make("div", { className: "plot" });
    this.#plot = new FieldPlot(plot);
    this.element = make("article", {
      className: "watch",
      children: [head, this.#figures, this.#problem, plot, this.#table, this.#cut],
    });
    this.element.setAttribute("aria-label", topic);
  }

  /**
   * @param {object} message as in `sample`; it is sent again if no new message came, so that its figures are
   *   current
   */
  show(message) {
    clearTimeout(this.#silence);
    this.#silence = setTimeout(() => this.#lost(), SILENCE_MS);
    mark(this.element, "stale", false);
    if (message.type !== "*") setText(this.#type, message.type);
    setText(this.#figures, figuresText(message));
    setTextOrHide(this.#problem, message.refusal?.text ?? "");
    const isNew = message.number !== this.#number;
    this.#number = message.number;
    this.#fields = message.fields;
    this.#lengths = new Map(Object.entries(message.shortened ?? {}));
    this.#fill();
    this.#plot.add(isNew ? message.fields : null);
  }

  close() {
    clearTimeout(this.#silence);
    this.#plot.close();
    this.element.remove();
  }

  /** The connection, the bridge or its inspector is gone: the message's age is no longer known. */
  #lost() {
    mark(this.element, "stale", true);
    setText(this.#figures, gettext("No new data: this is the last message."));
  }

  /**
   * Update the rows. Unchanged elements are kept, so that focus, scroll position and a press are not lost.
   */
  #fill() {
    const found = rows(this.#fields, this.#opened);
    const wanted = new Set(found.map(keyOf));
    for (const [key, { element }] of this.#rows) {
      if (wanted.has(key)) continue;
      element.remove();
      this.#rows.delete(key);
    }
    let next = this.#table.firstElementChild;
    for (const field of found) {
      const key = keyOf(field);
      if (!this.#rows.has(key)) this.#rows.set(key, this.#row(field));
      const { element, value } = this.#rows.get(key);
      if (element === next) next = next.nextElementSibling;
      else this.#table.insertBefore(element, next);
      const length = this.#lengths.get(field.path) ?? null;
      setText(value, field.isOpen ? "" : valueText(field.value, length));
    }
    show(this.#cut, found.length >= PATHS_AT_MOST);
  }

  #row({ path, depth, kind }) {
    const name = make("dt", { text: path.slice(path.lastIndexOf(".") + 1) });
    const value = make("span");
    const cell = make("dd", { children: [value] });
    if (kind === "number") cell.append(this.#plotButton(path));
    if (kind === "numbers") cell.append(this.#openButton(path));
    const element = make("div", { data: { depth: Math.min(depth, 6) }, children: [name, cell] });
    return { element, value };
  }

  #plotButton(path) {
    const words = interpolate(gettext("Plot %s"), [path]);
    const isOn = this.#plot.names.includes(path);
    return toggle(gettext("Plot"), words, isOn, (button) => {
      const on = !this.#plot.names.includes(path);
      const refused = this.#plot.put(path, on);
      if (refused) this.dispatchEvent(new CustomEvent("refused", { detail: refused }));
      else button.setAttribute("aria-pressed", String(on));
    });
  }

  #openButton(path) {
    const words = interpolate(gettext("Elements of %s"), [path]);
    const isOpen = this.#opened.has(path);
    return toggle(gettext("Elements"), words, isOpen, (button) => {
      const open = !this.#opened.delete(path);
      if (open) this.#opened.add(path);
      else this.#plot.put(path, false);
      button.setAttribute("aria-pressed", String(open));
      this.#fill();
    });
  }
}

function keyOf({ path, kind }) {
  return `${path} ${kind}`;
}

function toggle(text, label, isOn, pressed) {
  const button = makeButton({ className: "toggle small", text }, () => pressed(button));
  button.setAttribute("aria-pressed", String(isOn));
  button.setAttribute("aria-label", label);
  return button;
}
