/**
 * Rows of name and value in place of a JSON box. Without this script, people type into the box.
 *
 * `data-pairs` of a textarea is "text" (all values are texts) or "grouped": a name such as
 * "limits.forward_mps" is an entry of a group, and values are numbers, null or JSON if they can be parsed,
 * else texts.
 */

import { make, makeButton } from "../lib/dom.js";

/**
 * Return names and values of an object; null if the text is no such object.
 * @param {string} json
 * @param {string} kind
 */
export function pairsOf(json, kind) {
  let value;
  try {
    value = JSON.parse(json.trim() || "{}");
  } catch {
    return null;
  }
  if (!isObject(value)) return null;
  if (kind === "text") {
    const entries = Object.entries(value);
    return entries.every(([, text]) => typeof text === "string") ? entries : null;
  }
  if (!Object.values(value).every(isObject)) return null;
  return Object.entries(value).flatMap(([group, entries]) =>
    Object.entries(entries).map(([name, entry]) => [`${group}.${name}`, written(entry)]),
  );
}

/**
 * Return the object of these rows, as JSON; rows without a name are left out.
 * @param {string[][]} pairs
 * @param {string} kind
 */
export function jsonOf(pairs, kind) {
  const found = Object.create(null); // a name may be "__proto__" or "constructor"
  for (const [typed, value] of pairs) {
    const name = typed.trim();
    if (!name) continue;
    if (kind === "text") {
      found[name] = value.trim();
      continue;
    }
    const dot = name.indexOf(".");
    // The console refuses a name without a group, and gives the reason.
    if (dot < 0) found[name] = read(value);
    else {
      const group = name.slice(0, dot);
      if (!isObject(found[group])) found[group] = Object.create(null);
      found[group][name.slice(dot + 1)] = read(value);
    }
  }
  return JSON.stringify(found, null, 2);
}

function isObject(value) {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

function written(value) {
  return typeof value === "string" ? value : JSON.stringify(value);
}

function read(text) {
  try {
    return JSON.parse(text);
  } catch {
    return text.trim();
  }
}

/** Put rows before a box, hide the box, and keep its text up to date. @param {HTMLTextAreaElement} box */
export function showRows(box) {
  const kind = box.dataset.pairs;
  const pairs = pairsOf(box.value, kind);
  if (pairs === null) return; // a person must repair the JSON in the box
  const [nameExample, valueExample] = (box.dataset.example ?? "=").split("=");
  const list = make("div", { className: "pairs-list" });
  const label = box.labels[0]?.textContent.replace(/:\s*$/, "") ?? "";

  const rows = () =>
    [...list.children].map((row) => [...row.querySelectorAll("input")].map(({ value }) => value));
  const store = () => {
    box.value = jsonOf(rows(), kind);
  };
  const add = ([name, value]) => {
    const inputs = [
      [gettext("Name"), name, nameExample],
      [gettext("Value"), value, valueExample],
    ].map(([what, text, example]) => {
      const input = make("input", { className: "vTextField" });
      input.type = "text";
      input.value = text;
      input.placeholder = example;
      input.setAttribute("aria-label", `${label}: ${what}`);
      input.addEventListener("input", store);
      return input;
    });
    const remove = makeButton({ className: "button", text: gettext("Remove") }, () => {
      row.remove();
      store();
      addButton.focus();
    });
    const row = make("div", { className: "pairs-row", children: [...inputs, remove] });
    list.append(row);
    return inputs[0];
  };

  const addButton = makeButton({ className: "button", text: gettext("Add a row") }, () =>
    add(["", ""]).focus(),
  );
  const group = make("div", { className: "pairs", children: [list, addButton] });
  group.setAttribute("role", "group");
  group.setAttribute("aria-label", label);
  for (const pair of pairs) add(pair);
  box.before(group);
  box.hidden = true;
}
