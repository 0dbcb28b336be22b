/**
 * The one search: filters as one types, whatever the case and the accents.
 * In its field Esc clears, Enter acts on the only hit, Tab moves on to the hits.
 */

import { dim, make, makeButton, setText, show } from "./dom.js";

/** Text as it is compared: without accents, in small letters, the same in every browser's language. */
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
 * @param {() => void} filter shows what fits the field's value
 * @param {() => HTMLElement[]} hits what is shown; the first button or link of each is what Enter acts on
 */
export function searches(field, filter, hits) {
  field.addEventListener("input", filter);
  field.addEventListener("keydown", (event) => {
    if (event.isComposing) return; // the key is the writing aid's
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

/** Items without a group first, then by group, and within each as they came. */
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
   * @param {(item) => string} settings.text that is searched; shown is `name`, or else this
   * @param {(item) => ?string} [settings.note] beside it, quiet
   * @param {(item) => boolean} [settings.isOff] shown, but not to be acted on
   * @param {(item) => void} [settings.act] what a press does, unless there is a `row`
   * @param {(item) => HTMLElement} [settings.row] an own row, instead of a button
   * @param {(item) => string} [settings.group] its name, or "": items of one group are brought together below it
   * @param {(item) => unknown} [settings.key] by which an item is known again; without it, the text that is searched
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

  /** @param {object[]} items in their order; the focus stays in its row if that is still there */
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

  /** @param {boolean} dimmed the rows' buttons do nothing now, and say so @param {string} why */
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

  /** Rows, and before each group's first its name. */
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
