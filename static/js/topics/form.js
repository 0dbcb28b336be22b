/** A form for a message, made from its definition: nested fields, arrays, constants as choices, time. */

import { make, say, show } from "../dom.js";

const WHOLE = /^u?int(8|16|32|64)$|^byte$|^char$/;
const FRACTION = /^float(32|64)$/;

/** What a field holds before anybody writes there. */
function blankText(type) {
  if (type === "time") return "now";
  if (type === "duration" || WHOLE.test(type) || FRACTION.test(type)) return "0";
  return "";
}

/** A written value as the definition wants it. Throws an Error with words for a person. */
function parsed(text, type) {
  if (type === "string") return text;
  const trimmed = text.trim();
  if (type === "time" && trimmed === "now") return "now";
  if (trimmed === "") throw new Error(gettext("Write a number."));
  const value = Number(trimmed);
  if (!Number.isFinite(value)) throw new Error(gettext("This is not a number."));
  if (WHOLE.test(type) && !Number.isInteger(value))
    throw new Error(gettext("Write a whole number."));
  if (WHOLE.test(type) && !Number.isSafeInteger(value))
    throw new Error(gettext("A browser would lose digits of this: publish it with a program."));
  return value;
}

/** An array as it is written: values with commas between, or JSON for anything nested. */
function parsedArray(text, { type, array, fields = [] }) {
  const trimmed = text.trim();
  let values;
  if (fields.length || trimmed.startsWith("[")) {
    try {
      values = trimmed ? JSON.parse(trimmed) : [];
    } catch {
      throw new Error(gettext("Write a JSON list, such as [1, 2]."));
    }
    if (!Array.isArray(values)) throw new Error(gettext("Write a JSON list, such as [1, 2]."));
  } else {
    values = trimmed === "" ? [] : trimmed.split(",").map((part) => one(part.trim(), type));
  }
  if (array > 0 && values.length !== array) {
    throw new Error(interpolate(gettext("Write exactly %s values."), [array]));
  }
  return values;
}

function one(text, type) {
  if (type === "bool") return text === "true" || text === "1";
  return parsed(text, type);
}

/** The form of one message type. `values` reads it, `fault` shows what the robot's side found wrong. */
export class MessageForm {
  #root;
  #inputs = new Map(); // path -> {field, input, note}

  /** @param {HTMLElement} root is emptied. @param {object[]} fields as in the answer `described` */
  constructor(root, fields) {
    this.#root = root;
    root.replaceChildren(...fields.map((field) => this.#row(field, "")));
  }

  /** @returns {?object} nested values; null if something is wrong, which is then said beside it */
  get values() {
    const found = Object.create(null); // a field may be called "constructor"
    let right = true;
    for (const [path, { field, input, note }] of this.#inputs) {
      try {
        put(found, path.split("."), this.#value(field, input));
        this.#note(note, input, "");
      } catch (error) {
        this.#note(note, input, error.message);
        right = false;
      }
    }
    if (!right) this.#root.querySelector("[aria-invalid=true]")?.focus();
    return right ? found : null;
  }

  /** @param {string} path of the wrong field, perhaps within an array. @returns {boolean} whether it is in this form */
  fault(path, text) {
    const own = [...this.#inputs.keys()].find((key) => path === key || path.startsWith(`${key}[`));
    if (!own) return false;
    const { input, note } = this.#inputs.get(own);
    this.#note(note, input, text);
    input.focus();
    return true;
  }

  #value(field, input) {
    if (field.array !== null && field.array !== undefined) return parsedArray(input.value, field);
    if (field.type === "bool") return input.checked;
    return field.constants?.[input.value.trim()] ?? parsed(input.value, field.type);
  }

  #row(field, prefix) {
    const path = prefix ? `${prefix}.${field.name}` : field.name;
    if (field.fields?.length && (field.array === null || field.array === undefined)) {
      const legend = make("legend", { text: `${field.name} · ${field.type}` });
      const inner = field.fields.map((child) => this.#row(child, path));
      return make("fieldset", { className: "nested", children: [legend, ...inner] });
    }
    const input = this.#input(field);
    const proposals = this.#proposals(field);
    const note = make("span", { className: "field-note" });
    note.hidden = true;
    const id = `field-${path.replaceAll(".", "-")}`;
    input.id = id;
    if (proposals) {
      proposals.id = `${id}-constants`;
      input.setAttribute("list", proposals.id);
    }
    note.id = `${id}-note`;
    input.setAttribute("aria-describedby", note.id);
    const label = make("label", {
      children: [
        make("span", { text: field.name }),
        make("span", { className: "quiet", text: typeText(field) }),
      ],
    });
    label.htmlFor = id;
    this.#inputs.set(path, { field, input, note });
    return make("div", {
      className: "field",
      children: [label, input, proposals, note].filter(Boolean),
    });
  }

  /** The names of the constants of its type, to choose from; any other value may be written, too. */
  #proposals({ type, array, constants = {} }) {
    const isArray = array !== null && array !== undefined;
    const named = Object.entries(constants);
    if (isArray || type === "bool" || !named.length) return null;
    const options = named.map(([name, value]) => {
      const option = make("option", { text: `${name} = ${value}` });
      option.value = name;
      return option;
    });
    return make("datalist", { children: options });
  }

  #input(field) {
    const isArray = field.array !== null && field.array !== undefined;
    const input = make("input");
    input.type = !isArray && field.type === "bool" ? "checkbox" : "text";
    if (isArray) input.placeholder = field.fields?.length ? "[]" : "1, 2, 3";
    else if (field.type !== "bool") input.value = blankText(field.type);
    if (isArray && field.array > 0 && !field.fields?.length) {
      input.value = Array(field.array).fill(blankText(field.type)).join(", ");
    }
    input.autocomplete = "off";
    input.spellcheck = false;
    return input;
  }

  #note(note, input, text) {
    say(note, text);
    show(note, text !== "");
    if (text) input.setAttribute("aria-invalid", "true");
    else input.removeAttribute("aria-invalid");
  }
}

function typeText({ type, array }) {
  if (array === null || array === undefined) return type;
  return array < 0 ? `${type}[]` : `${type}[${array}]`;
}

function put(found, [name, ...rest], value) {
  if (!rest.length) {
    found[name] = value;
    return;
  }
  found[name] ??= Object.create(null);
  put(found[name], rest, value);
}
