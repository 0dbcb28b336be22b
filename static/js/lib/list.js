/**
 * The search of all lists: filters while a person types, and ignores case and accents.
 * In its field Esc clears the text, Enter presses the only hit, Tab moves to the hits.
 */

import { dim, make, makeButton, setText, show } from "./dom.js";

/** Return a text for comparison: without accents, in small letters, by the same rules in every language. */
function folded(text) {
  return text.normalize("NFD").replace(/\p{M}/gu, "").toLowerCase();
}

/** Return whether every word of a search is somewhere in a text. */
export function matches(text, search) {
  const searched = folded(text);
  return folded(search)
    .split(/\s+/)
    .every((word) => searched.includes(word));
}

/**
 * Adds a search to a field.
 * @param {HTMLInputElement} field
 * @param {() => void} filter shows the rows that match the field's value
 * @param {() => HTMLElement[]} hits the rows that are shown; if there is only one, Enter presses its first
 *   button or link
 */
export function searches(field, filter, hits) {
  field.addEventListener("input", filter);
  field.addEventListener("keydown", (event) => {
    if (event.isComposing) return; // the key belongs to the input method
    if (event.key === "Escape" && field.value) {
      event.preventDefault();
      event.stopPropagation();
      field.value = "";
      filter();
    } else if (event.key === "Enter") {
      event.preventDefault();
      const [only, ...more] = hits();
      if (only && more.length === 0) only.querySelector("a, button:not(:disabled)")?.click();
    }
  });
}

/** Return items by group: items without a group first. The order within a group is kept. */
function grouped(items, group) {
  const names = [...new Set(["", ...items.map(group)])];
  return names.flatMap((name) => items.filter((item) => group(item) === name));
}

let lists = 0;

export class SearchList {
  #root;
  #field;
  #hits;
  #none;
  #empty = make("p", { className: "quiet" });
  #settings;
  #items = [];
  #rows = [];
  #groups = new Map();
  #dimmed = [false, ""];

  /**
   * @param {HTMLElement} root is filled with field and list
   * @param {object} settings
   * @param {string} settings.label of the field
   * @param {(item) => string} settings.text the text that is searched; also shown if the item has no `name`
   * @param {(item) => ?string} [settings.note] a less prominent text, shown with the item
   * @param {(item) => boolean} [settings.isOff] the item is shown, but its button is disabled
   * @param {(item) => void} [settings.act] called when an item is pressed; not used with `row`
   * @param {(item) => HTMLElement} [settings.row] makes an item's row, in place of a button
   * @param {(item) => string} [settings.group] the name of the item's group, or "": a group is listed below
   *   its name
   * @param {(item) => unknown} [settings.key] identifies an item when `items` is set again; without it,
   *   `text` does
   */
  constructor(root, settings) {
    this.#root = root;
    this.#settings = settings;
    lists += 1;
    const id = `list-${lists}`;
    this.#field = make("input");
    this.#field.type = "search";
    this.#field.placeholder = settings.label;
    this.#field.autocomplete = "off";
    this.#field.setAttribute("aria-label", settings.label);
    this.#field.setAttribute("aria-controls", id);
    this.#hits = make("ul", { className: "hits" });
    this.#hits.id = id;
    this.#none = make("p", { className: "quiet", text: gettext("No match.") });
    this.#none.hidden = true;
    this.#none.setAttribute("role", "status");
    this.#field.hidden = true; // until there is something to search
    searches(
      this.#field,
      () => this.#filter(),
      () => this.#rows.filter((row) => !row.hidden),
    );
    root.classList.add("searchable");
    this.#empty.hidden = true;
    root.replaceChildren(this.#field, this.#hits, this.#none, this.#empty);
  }

  /** @param {object[]} items in their order; the focus stays in its row if that row still exists */
  set items(given) {
    const { text, key = text, group } = this.#settings;
    const items = group ? grouped(given, group) : given;
    const held = this.#items[this.#rows.findIndex((row) => row.contains(document.activeElement))];
    this.#items = items;
    this.#rows = items.map((item) => this.#row(item));
    this.#groups = new Map();
    this.#hits.replaceChildren(...this.#headed());
    this.#filter();
    this.dim(...this.#dimmed);
    show(this.#field, items.length > 0);
    this.empty = this.#empty.textContent;
    if (held === undefined) return;
    const again = items.findIndex((item) => key(item) === key(held));
    this.#rows[again]?.querySelector("button")?.focus();
  }

  get items() {
    return this.#items;
  }

  /** @param {boolean} dimmed the rows' buttons are marked as disabled @param {string} why the reason */
  dim(dimmed, why) {
    this.#dimmed = [dimmed, why];
    for (const button of this.#hits.querySelectorAll("button")) dim(button, dimmed, why);
  }

  /** @param {string} text shown while there are no items at all */
  set empty(text) {
    setText(this.#empty, text);
    show(this.#empty, text !== "" && this.#items.length === 0);
  }

  focus() {
    this.#field.focus();
  }

  /** Shows everything again. */
  clear() {
    this.#field.value = "";
    this.#filter();
  }

  close() {
    this.#root.replaceChildren();
  }

  /** Return the rows, with each group's name before its first row. */
  #headed() {
    const { group } = this.#settings;
    if (!group) return this.#rows;
    return this.#rows.flatMap((row, i) => {
      const name = group(this.#items[i]);
      if (!name || this.#groups.has(name)) return [row];
      const heading = make("li", { className: "group", text: name });
      this.#groups.set(name, heading);
      return [heading, row];
    });
  }

  #row(item) {
    const { row, act, isOff } = this.#settings;
    if (row) return make("li", { children: [row(item)] });
    const button = makeButton({ className: "hit", children: this.#words(item) }, () => act(item));
    button.disabled = isOff?.(item) ?? false;
    return make("li", { children: [button] });
  }

  #words(item) {
    const text = item.name ?? this.#settings.text(item);
    const lines = [make("span", { className: "hit-name", text })];
    const note = this.#settings.note?.(item);
    if (note) lines.push(make("span", { className: "hit-note", text: note }));
    return [make("span", { className: "hit-words", children: lines })];
  }

  #filter() {
    const { text, group } = this.#settings;
    const groups = new Set();
    let shown = 0;
    for (const [i, item] of this.#items.entries()) {
      const fits = matches(text(item), this.#field.value);
      show(this.#rows[i], fits);
      if (!fits) continue;
      shown += 1;
      groups.add(group?.(item));
    }
    for (const [name, heading] of this.#groups) show(heading, groups.has(name));
    show(this.#none, shown === 0 && this.#items.length > 0);
  }
}
