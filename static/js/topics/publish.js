/**
 * Publishes on topics of the allow-list: by a form from the definition, or by a dictionary with dotted keys.
 */

import { whyNotNow } from "../control/lease.js";
import { dim, make, makeButton, setTextOrHide, show } from "../lib/dom.js";
import { MessageForm } from "./form.js";
import { parsedJson } from "./value_parsing.js";

const RATE_HZ = [0.1, 50]; // the slowest and the fastest; 0 publishes once

/** Parse a dictionary that a person wrote. Throws an Error with a sentence for people. */
export function dictionary(text) {
  let found = null;
  try {
    found = parsedJson(text.trim() || "{}");
  } catch (error) {
    if (!(error instanceof SyntaxError)) throw error;
  }
  if (found === null || Object.getPrototypeOf(found) !== Object.prototype) {
    throw new Error(gettext('Write a dictionary, such as {"linear.x": 0.2}.'));
  }
  return found;
}

/** Events: "publish" {topic, type, fields, rate_hz}, "stop" {topic}. */
export class PublishPanel extends EventTarget {
  #parts;
  #describe;
  #types = {}; // by topic
  #running = [];
  #mayAct = false;
  #form = null;
  #listening = new AbortController();

  /**
   * @param {Object<string, HTMLElement>} parts those of the panel, by data-part
   * @param {(topic: string, type: string) => Promise<object>} describe requests a definition
   */
  constructor(parts, describe) {
    super();
    this.#parts = parts;
    this.#describe = describe;
    const { signal } = this.#listening;
    parts["publish-topic"].addEventListener("change", () => this.#choose(), { signal });
    parts["publish-as"].addEventListener("change", () => this.#showForm(), { signal });
    parts["publish-form"].addEventListener("submit", (event) => this.#submit(event), { signal });
  }

  /**
   * @param {{topic: string, type: string, why: string}[]} publishable `why`: the reason why this person may
   *   not, empty if they may
   */
  set publishable(publishable) {
    const before = this.#parts["publish-topic"].value;
    const typeBefore = this.#types[before];
    this.#types = Object.fromEntries(publishable.map(({ topic, type }) => [topic, type]));
    const options = publishable.map(({ topic, type, why }) => {
      const option = make("option", { text: [topic, type, why].filter(Boolean).join(" · ") });
      option.value = topic;
      option.disabled = why !== "";
      return option;
    });
    this.#parts["publish-topic"].replaceChildren(...options);
    show(this.#parts["publish-none"], options.length === 0);
    show(this.#parts["publish-form"], options.length > 0);
    const kept = before in this.#types;
    const first = publishable.find(({ why }) => why === "");
    this.#parts["publish-topic"].value = kept ? before : (first?.topic ?? "");
    if (this.#types[before] !== typeBefore || !kept) this.#choose();
  }

  /** The connection is open: request the definition of a topic that was chosen before. */
  connected() {
    if (!this.#form) this.#choose();
  }

  /** @param {{topic, type, rate_hz}[]} running topics that are published at a rate */
  set running(running) {
    if (JSON.stringify(running) === JSON.stringify(this.#running)) return;
    this.#running = running;
    const items = running.map(({ topic, rate_hz: rateHz }) => {
      const stop = makeButton({ className: "button", text: gettext("Stop") }, () =>
        this.#emit("stop", { topic }),
      );
      dim(stop, !this.#mayAct, whyNotNow());
      const words = make("span", { children: [make("code", { text: topic }), ` ${rateHz} Hz`] });
      return make("li", { children: [words, stop] });
    });
    this.#parts["publish-running"].replaceChildren(...items);
  }

  /** @param {?boolean} may whether this tab has control; null: not known yet */
  set mayAct(may) {
    this.#mayAct = may;
    const stops = this.#parts["publish-running"].querySelectorAll("button");
    for (const button of [this.#parts["publish-send"], ...stops]) dim(button, !may, whyNotNow());
    show(this.#parts["publish-control"], may === false);
  }

  /**
   * Mark the field that the robot's side refused in the last message; the refusal itself is already shown.
   */
  fault({ text, figures = {} }) {
    if (figures.path === undefined) return;
    const inForm = this.#usesForm && this.#form?.fault(figures.path, text);
    this.#showText(inForm ? "" : text);
  }

  close() {
    this.#listening.abort();
  }

  get #usesForm() {
    return this.#parts["publish-as"].value === "form";
  }

  async #choose() {
    const topic = this.#parts["publish-topic"].value;
    const type = this.#types[topic];
    this.#form = null;
    this.#parts["publish-fields"].replaceChildren();
    if (!type) return;
    this.#showText("");
    try {
      const { fields } = await this.#describe(topic, type);
      if (this.#parts["publish-topic"].value !== topic) return; // another topic was chosen since
      this.#form = new MessageForm(this.#parts["publish-fields"], fields);
    } catch (error) {
      this.#showText(error.message);
    }
  }

  #showForm() {
    show(this.#parts["publish-fields"], this.#usesForm);
    show(this.#parts["publish-text-row"], !this.#usesForm);
  }

  #submit(event) {
    event.preventDefault();
    const topic = this.#parts["publish-topic"].value;
    const fields = this.#read();
    if (fields === null) return;
    const rateHz = this.#rate();
    if (rateHz === null) return;
    this.#emit("publish", { topic, type: this.#types[topic], fields, rate_hz: rateHz });
  }

  #read() {
    this.#showText("");
    if (this.#usesForm) return this.#form?.values ?? null;
    try {
      return dictionary(this.#parts["publish-text"].value);
    } catch (error) {
      this.#showText(error.message);
      return null;
    }
  }

  /** Return the rate, 0 for once. If the input is no rate, show an error and return null. */
  #rate() {
    const input = this.#parts["publish-rate"];
    const rateHz = input.validity.badInput ? Number.NaN : Number(input.value);
    const right = rateHz === 0 || (rateHz >= RATE_HZ[0] && rateHz <= RATE_HZ[1]);
    input.setAttribute("aria-invalid", String(!right));
    if (right) return rateHz;
    const text = gettext("Rate: from %(slowest)s to %(fastest)s Hz, or 0 for once.");
    const [slowest, fastest] = RATE_HZ;
    this.#showText(interpolate(text, { slowest, fastest }, true));
    input.focus();
    return null;
  }

  #showText(text) {
    setTextOrHide(this.#parts["publish-fault"], text);
  }

  #emit(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}
