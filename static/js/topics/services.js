/**
 * The robot's services and parameters: everybody may read, staff may call and set what the allow-list admits.
 */

import { make, mark, setText, setTextOrHide, show } from "../lib/dom.js";
import { MessageForm } from "./form.js";

/** A service's answer; long arrays are marked as shortened. */
function answerText({ fields, shortened = {} }) {
  const text = JSON.stringify(fields, null, 2);
  const cut = Object.entries(shortened).map(([path, length]) => `${path} (${length})`);
  if (cut.length === 0) return text;
  return `${text}\n${interpolate(gettext("Shown in part: %s"), [cut.join(", ")])}`;
}

/** Calls one service, by a form that is made from the service's definition. */
export class ServiceCall {
  element;
  #channel;
  #service;
  #form = null;
  #fields;
  #answer;
  #call;

  /** @param {object} channel to ask @param {string} service @param {boolean} mayCall */
  constructor(channel, service, mayCall) {
    this.#channel = channel;
    this.#service = service;
    this.#fields = make("div", { className: "fields" });
    this.#answer = make("pre", { className: "answer" });
    this.#answer.hidden = true;
    this.#answer.setAttribute("aria-live", "polite");
    this.#call = make("button", { className: "button primary", text: gettext("Call") });
    show(this.#call, mayCall);
    const form = make("form", { children: [this.#fields, this.#call] });
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#send();
    });
    const title = make("h3", { children: [make("code", { text: service })] });
    this.element = make("article", { className: "watch", children: [title, form, this.#answer] });
    this.#describe();
  }

  async #describe() {
    try {
      const { type, fields } = await this.#channel.ask({
        t: "describe_service",
        service: this.#service,
      });
      this.element
        .querySelector("h3")
        .append(" ", make("span", { className: "quiet", text: type.replace(/_?Request$/, "") }));
      this.#form = new MessageForm(this.#fields, fields);
    } catch (error) {
      this.#showAnswer(error.message, true);
    }
  }

  async #send() {
    const fields = this.#form?.values;
    if (!fields) return;
    this.#call.disabled = true;
    try {
      const answer = await this.#channel.ask({ t: "call", service: this.#service, fields });
      this.#showAnswer(answerText(answer));
    } catch (error) {
      const path = error.refusal?.figures?.path;
      if (path && this.#form.fault(path, error.message)) show(this.#answer, false);
      else this.#showAnswer(error.message, true);
    } finally {
      this.#call.disabled = false;
    }
  }

  #showAnswer(text, isFault = false) {
    mark(this.#answer, "fault", isFault);
    setText(this.#answer, text);
    show(this.#answer, true);
  }
}

/** One parameter: its value, and for staff a field to set it. */
export class ParameterView {
  element;
  #channel;
  #name;
  #value;
  #set;
  #maySet;
  #outcome;

  /** @param {object} channel to ask @param {string} name @param {boolean} maySet */
  constructor(channel, name, maySet) {
    this.#channel = channel;
    this.#name = name;
    this.#maySet = maySet;
    this.#value = make("textarea");
    this.#value.rows = 3;
    this.#value.spellcheck = false;
    this.#value.setAttribute("aria-label", interpolate(gettext("Value of %s"), [name]));
    this.#outcome = make("p", { className: "answer" });
    this.#outcome.hidden = true;
    this.#outcome.setAttribute("role", "alert");
    this.#set = make("button", { className: "button", text: gettext("Set") });
    show(this.#set, maySet);
    const form = make("form", { children: [this.#value, this.#set] });
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#setIt();
    });
    const title = make("h3", { children: [make("code", { text: name })] });
    this.element = make("article", { className: "watch", children: [title, form, this.#outcome] });
    this.#ask({ t: "parameter", name }, "");
  }

  #setIt() {
    let value;
    try {
      value = JSON.parse(this.#value.value);
    } catch {
      this.#showText(gettext('Write a value as JSON: 0.5, true, "text", [1, 2].'), true);
      return;
    }
    this.#ask({ t: "set_parameter", name: this.#name, value }, gettext("Set."));
  }

  /** @param {string} done text to show after the answer */
  async #ask(question, done) {
    this.#set.disabled = true;
    this.#value.readOnly = true; // the answer replaces the text
    try {
      const { value } = await this.#channel.ask(question);
      this.#value.value = JSON.stringify(value, null, 2);
      this.#showText(done);
    } catch (error) {
      this.#showText(error.message, true);
    } finally {
      this.#set.disabled = false;
      this.#value.readOnly = !this.#maySet;
    }
  }

  #showText(text, isFault = false) {
    mark(this.#outcome, "fault", isFault);
    setTextOrHide(this.#outcome, text);
  }
}
