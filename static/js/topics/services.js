/** The robot's services and parameters: everybody may read, staff may call and set what the allow-list admits. */

import { make, say, show } from "../dom.js";
import { MessageForm } from "./form.js";

/** Calls one service. Its form is made when it is opened. */
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
        .append(" ", make("span", { className: "quiet", text: type }));
      this.#form = new MessageForm(this.#fields, fields);
    } catch (error) {
      this.#tell(error.message);
    }
  }

  async #send() {
    const fields = this.#form?.values;
    if (!fields) return;
    this.#call.disabled = true;
    try {
      const answer = await this.#channel.ask({ t: "call", service: this.#service, fields });
      this.#tell(JSON.stringify(answer.fields, null, 2));
    } catch (error) {
      const path = error.refusal?.figures?.path;
      if (!path || !this.#form.fault(path, error.message)) this.#tell(error.message);
    } finally {
      this.#call.disabled = false;
    }
  }

  #tell(text) {
    say(this.#answer, text);
    show(this.#answer, true);
  }
}

/** One parameter: its value, and for staff a field to set it. */
export class ParameterView {
  element;
  #channel;
  #name;
  #value;
  #fault;

  /** @param {object} channel to ask @param {string} name @param {boolean} maySet */
  constructor(channel, name, maySet) {
    this.#channel = channel;
    this.#name = name;
    this.#value = make("textarea");
    this.#value.rows = 3;
    this.#value.readOnly = !maySet;
    this.#value.spellcheck = false;
    this.#value.setAttribute("aria-label", interpolate(gettext("Value of %s"), [name]));
    this.#fault = make("p", { className: "why" });
    this.#fault.hidden = true;
    this.#fault.setAttribute("role", "alert");
    const set = make("button", { className: "button", text: gettext("Set") });
    show(set, maySet);
    const form = make("form", { children: [this.#value, set] });
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#set();
    });
    const title = make("h3", { children: [make("code", { text: name })] });
    this.element = make("article", { className: "watch", children: [title, form, this.#fault] });
    this.#ask({ t: "parameter", name });
  }

  #set() {
    let value;
    try {
      value = JSON.parse(this.#value.value);
    } catch {
      this.#say(gettext('Write a value as JSON: 0.5, true, "text", [1, 2].'));
      return;
    }
    this.#ask({ t: "set_parameter", name: this.#name, value });
  }

  async #ask(question) {
    try {
      const { value } = await this.#channel.ask(question);
      this.#value.value = JSON.stringify(value, null, 2);
      this.#say("");
    } catch (error) {
      this.#say(error.message);
    }
  }

  #say(text) {
    say(this.#fault, text);
    show(this.#fault, text !== "");
  }
}
