/**
 * A form for a message, made from its definition: nested fields, lists of messages, constants as choices,
 * time.
 */

import { make, makeButton, setText, setTextOrHide } from "../lib/dom.js";
import { blankText, parsed, parsedArray } from "./value_parsing.js";

const MOST_MADE = 20; // messages in a list of fixed length: a longer list is written as JSON

/**
 * The form of one message type. `values` reads the form, `fault` shows an error that the robot's side found.
 */
export class MessageForm {
  #root;
  #message;

  /** @param {HTMLElement} root is emptied. @param {object[]} fields as in the answer `described` */
  constructor(root, fields) {
    this.#root = root;
    this.#message = new Message(fields, "");
    root.replaceChildren(...this.#message.rows);
  }

  /** @returns {?object} nested values; null if a value is wrong: its field then shows the error */
  get values() {
    const values = this.#message.values();
    const wrong = this.#root.querySelector("[aria-invalid=true]");
    wrong?.focus();
    return wrong ? null : values;
  }

  /**
   * @param {string} path of the wrong field, as `points[0].x`.
   * @returns {boolean} whether the form has this field
   */
  fault(path, text) {
    const found = this.#message.find(path.match(/[^.[\]]+/g) ?? []);
    found?.fault(text);
    return Boolean(found);
  }
}

/** The fields of one message. */
class Message {
  #parts = new Map(); // by the field's name

  constructor(fields, prefix) {
    for (const field of fields) this.#parts.set(field.name, part(field, `${prefix}-${field.name}`));
  }

  get rows() {
    return [...this.#parts.values()].map(({ element }) => element);
  }

  values() {
    const found = Object.create(null); // a field may be called "constructor"
    for (const [name, inner] of this.#parts) found[name] = inner.values();
    return found;
  }

  find([name, ...rest]) {
    return this.#parts.get(name)?.find(rest) ?? null;
  }
}

/** @param {string} id unique in the form */
function part(field, id) {
  if (!isMessage(field) || field.array > MOST_MADE) return new Value(field, id);
  return isArray(field) ? new List(field, id) : new Nested(field, id);
}

/** A message within the message. */
class Nested {
  element;
  #message;

  constructor({ name, type, fields = [] }, id) {
    this.#message = new Message(fields, id);
    this.element = fieldset(name, type, this.#message.rows);
  }

  values() {
    return this.#message.values();
  }

  find(path) {
    return this.#message.find(path);
  }
}

/** A list of messages within the message: as many as the definition fixes, or as many as the person adds. */
class List {
  element;
  #field;
  #id;
  #items = [];
  #made = 0;
  #list = make("div", { className: "fields" });
  #note;

  constructor(field, id) {
    this.#field = field;
    this.#id = id;
    this.#note = noteAt(`field${id}-note`);
    this.#note.setAttribute("role", "alert");
    this.element = fieldset(field.name, typeText(field), [this.#list, this.#note]);
    for (let count = field.array; count > 0; count -= 1) this.#add();
    if (field.array < 0) this.element.append(this.#adding());
  }

  values() {
    this.fault("");
    return this.#items.map(({ message }) => message.values());
  }

  find([number, ...rest]) {
    return this.#items[number]?.message.find(rest) ?? this;
  }

  fault(text) {
    setTextOrHide(this.#note, text);
  }

  #adding() {
    const label = interpolate(gettext("Add one to %s"), [this.#field.name]);
    return labelled(gettext("Add"), label, () => {
      this.#add();
      this.#list.lastElementChild.querySelector("input, select, button")?.focus();
    });
  }

  #add() {
    const message = new Message(this.#field.fields ?? [], `${this.#id}-${this.#made}`);
    const element = fieldset("", "", message.rows);
    const item = { message, element, remove: null };
    this.#made += 1;
    if (this.#field.array < 0) {
      item.remove = labelled(gettext("Remove"), "", () => this.#remove(item));
      element.append(item.remove);
    }
    this.#items.push(item);
    this.#list.append(element);
    this.#number();
  }

  #remove(item) {
    this.#items.splice(this.#items.indexOf(item), 1);
    item.element.remove();
    this.#number();
    this.element.lastElementChild.focus(); // the button that adds a message
  }

  #number() {
    for (const [number, { element, remove }] of this.#items.entries()) {
      const name = `${this.#field.name}[${number}]`;
      setText(element.querySelector("legend > span"), name);
      remove?.setAttribute("aria-label", interpolate(gettext("Remove %s"), [name]));
    }
  }
}

/** One value, or an array of plain values. */
class Value {
  element;
  #field;
  #input;
  #choice;
  #note;

  constructor(field, id) {
    this.#field = field;
    this.#input = inputFor(field);
    this.#input.id = `field${id}`;
    this.#note = noteAt(`field${id}-note`);
    this.#input.setAttribute("aria-describedby", this.#note.id);
    const label = make("label", { children: named(field.name, typeText(field)) });
    label.htmlFor = this.#input.id;
    this.#choice = this.#choiceOf(field);
    const written = make("div", {
      className: "written",
      children: [this.#input, this.#choice].filter(Boolean),
    });
    this.element = make("div", { className: "field", children: [label, written, this.#note] });
  }

  values() {
    this.fault("");
    try {
      return this.#value();
    } catch (error) {
      this.fault(error.message);
      return null;
    }
  }

  find() {
    return this;
  }

  fault(text) {
    setTextOrHide(this.#note, text);
    if (text) this.#input.setAttribute("aria-invalid", "true");
    else this.#input.removeAttribute("aria-invalid");
    if (text) this.#input.focus();
  }

  #value() {
    if (isArray(this.#field)) return parsedArray(this.#input.value, this.#field);
    if (this.#input.type === "checkbox") return this.#input.checked;
    return parsed(this.#input.value, this.#field);
  }

  /** Return a choice of the constants of the field's type. The person may also write another value. */
  #choiceOf(field) {
    const constants = Object.entries(field.constants ?? {});
    if (isArray(field) || field.type === "bool" || !constants.length) return null;
    const choice = make("select");
    choice.setAttribute("aria-label", interpolate(gettext("Constants of %s"), [field.name]));
    choice.append(option("", gettext("another value")));
    for (const [name, value] of constants) choice.append(option(name, `${name} = ${value}`));
    const read = () => {
      const text = this.#input.value.trim();
      const same = constants.find(([name, value]) => text === name || text === String(value));
      choice.value = same?.[0] ?? "";
    };
    choice.addEventListener("change", () => {
      if (choice.value) this.#input.value = choice.value;
      else this.#input.select();
    });
    this.#input.addEventListener("input", read);
    read();
    return choice;
  }
}

function inputFor(field) {
  const input = make("input");
  const isOne = !isArray(field);
  input.type = isOne && field.type === "bool" ? "checkbox" : "text";
  input.autocomplete = "off";
  input.spellcheck = false;
  const blank = field.type === "bool" ? "false" : blankText(field.type);
  if (isOne) input.value = input.type === "text" ? blank : "on";
  else if (isMessage(field)) input.placeholder = "[{}, {}]";
  else if (field.array > 0) input.value = Array(field.array).fill(blank).join(", ");
  else input.placeholder = field.type === "string" ? "a, b" : `${blank}, ${blank}`;
  return input;
}

function isMessage({ type }) {
  return type.includes("/") && !type.startsWith("builtin_interfaces/");
}

function isArray({ array }) {
  return array !== null && array !== undefined;
}

function typeText({ type, array }) {
  if (!isArray({ array })) return type;
  return array < 0 ? `${type}[]` : `${type}[${array}]`;
}

function named(name, type) {
  return [make("span", { text: name }), make("span", { className: "quiet", text: type })];
}

function fieldset(name, type, children) {
  const legend = make("legend", { children: named(name, type) });
  return make("fieldset", { className: "nested", children: [legend, ...children] });
}

function noteAt(id) {
  const note = make("span", { className: "field-note" });
  note.hidden = true;
  note.id = id;
  return note;
}

function labelled(text, label, press) {
  const made = makeButton({ className: "button", text }, press);
  made.setAttribute("aria-label", label);
  return made;
}

function option(value, text) {
  const made = make("option", { text });
  made.value = value;
  return made;
}
