/**
 * The command palette: one search over what a person may do and open here. The arrow keys choose an entry, Enter does
 * it. Without a search, Enter does nothing until an arrow key has chosen: a robot never moves by Enter alone.
 */

import { closable } from "../lib/dialog.js";
import { make, makeButton, setText, show } from "../lib/dom.js";
import { matches } from "../lib/list.js";

/**
 * @typedef {object} Entry
 * @property {string} name
 * @property {string} does in words, what the entry does; empty: nothing
 * @property {string} [more] is searched, too, but not shown
 * @property {string} [language] of the name, if it is not the page's
 * @property {() => string} [why] why it cannot be done now; empty: it can
 * @property {() => void} act
 */

/** Return the entries that match, those first whose name does. @param {Entry[]} entries @param {string} search */
export function found(entries, search) {
  if (!search) return entries;
  const byName = ({ name }) => matches(name, search);
  const byRest = (entry) =>
    !byName(entry) && matches([entry.name, entry.does, entry.more].join(" "), search);
  return [...entries.filter(byName), ...entries.filter(byRest)];
}

export class Palette {
  #sources;
  #dialog;
  #field = make("input");
  #list = make("ul", { className: "palette-list" });
  #none = make("p", { className: "quiet" });
  #found = new Map(); // entries by their source
  #shown = [];
  #chosen = null;
  #listening = new AbortController();

  /**
   * @param {HTMLElement} root gets the dialog
   * @param {string} label of the search
   * @param {(() => Entry[] | Promise<Entry[]>)[]} sources are read each time that the palette opens
   */
  constructor(root, label, sources) {
    this.#sources = sources;
    this.#dialog = this.#made(label);
    root.append(this.#dialog);
    const { signal } = this.#listening;
    const on = (target, type, act) => target.addEventListener(type, act, { signal });
    on(this.#field, "input", () => this.#search());
    on(this.#field, "keydown", (event) => this.#key(event));
    // A press on an entry leaves the focus in the field.
    on(this.#list, "mousedown", (event) => event.preventDefault());
    // As a menu does: a press elsewhere closes it.
    on(this.#dialog, "focusout", () => setTimeout(() => this.#followFocus()));
    closable(this.#dialog, signal);
  }

  toggle() {
    if (this.#dialog.open) return this.#dialog.close();
    if (document.querySelector("dialog[open]")) return; // nothing acts beside it
    this.#found.clear();
    this.#field.value = "";
    this.#search();
    this.#dialog.show();
    this.#field.focus();
    for (const source of this.#sources) this.#read(source);
  }

  /** Show again what can be done now. */
  refresh() {
    if (this.#dialog.open) this.#show();
  }

  close() {
    this.#listening.abort();
    this.#dialog.remove();
  }

  #made(label) {
    const close = makeButton(
      { className: "palette-close", text: "×", data: { close: "" } },
      () => {},
    );
    close.setAttribute("aria-label", gettext("Close"));
    this.#list.id = "palette-list";
    this.#list.setAttribute("role", "listbox");
    this.#list.setAttribute("aria-label", label);
    this.#none.setAttribute("role", "status");
    const field = this.#field;
    field.type = "search";
    field.placeholder = label;
    field.autocomplete = "off";
    for (const [name, value] of Object.entries({
      role: "combobox",
      "aria-label": label,
      "aria-controls": this.#list.id,
      "aria-expanded": "true",
      "aria-autocomplete": "list",
    }))
      field.setAttribute(name, value);
    const head = make("div", { className: "palette-head", children: [field, close] });
    const dialog = make("dialog", {
      className: "dialog palette",
      children: [head, this.#none, this.#list],
    });
    dialog.setAttribute("aria-label", label);
    dialog.tabIndex = -1; // a press between the entries is still a press in the dialog
    return dialog;
  }

  async #read(source) {
    try {
      this.#found.set(source, await source());
    } catch ({ message }) {
      this.#found.set(source, [{ name: message, does: "", why: () => message, act() {} }]);
    }
    this.refresh();
  }

  #followFocus() {
    if (this.#dialog.open && !this.#dialog.contains(document.activeElement)) this.#dialog.close();
  }

  #search() {
    this.#chosen = null;
    this.#show();
  }

  #show() {
    const search = this.#field.value.trim();
    this.#shown = found(
      this.#sources.flatMap((source) => this.#found.get(source) ?? []),
      search,
    );
    // The choice stays while more is read.
    if (!this.#shown.includes(this.#chosen)) this.#chosen = (search && this.#shown[0]) || null;
    this.#list.replaceChildren(...this.#shown.map((entry, at) => this.#row(entry, at)));
    setText(this.#none, search && this.#shown.length === 0 ? gettext("No match.") : "");
    show(this.#none, this.#none.textContent !== "");
    this.#mark();
  }

  #row(entry, at) {
    const { name, does, language } = entry;
    const why = entry.why?.() ?? "";
    const words = make("span", { className: "palette-name", text: name });
    if (language) words.lang = language;
    const note = make("span", {
      className: "palette-note",
      text: [does, why].filter(Boolean).join(" · "),
    });
    const row = make("li", { className: "palette-entry", children: [words, note] });
    row.id = `palette-${at}`;
    row.setAttribute("role", "option");
    if (why) row.setAttribute("aria-disabled", "true");
    row.addEventListener("click", () => this.#do(entry));
    return row;
  }

  #mark() {
    const at = this.#shown.indexOf(this.#chosen);
    for (const [i, row] of [...this.#list.children].entries())
      row.setAttribute("aria-selected", String(i === at));
    if (at < 0) return this.#field.removeAttribute("aria-activedescendant");
    this.#field.setAttribute("aria-activedescendant", `palette-${at}`);
    this.#list.children[at].scrollIntoView({ block: "nearest" });
  }

  #key(event) {
    if (event.isComposing) return; // the key belongs to the input method
    const steps = { ArrowDown: 1, ArrowUp: -1 };
    if (event.key in steps) this.#step(steps[event.key]);
    else if (event.key === "Enter") event.repeat || this.#do(this.#chosen);
    else if (event.key === "Escape" && this.#field.value) this.#clear(event);
    else return;
    event.preventDefault();
  }

  #step(by) {
    const { length } = this.#shown;
    if (length === 0) return;
    const at = this.#shown.indexOf(this.#chosen);
    const next = at < 0 && by < 0 ? length - 1 : at + by;
    this.#chosen = this.#shown[(next + length) % length];
    this.#mark();
  }

  #clear(event) {
    event.stopPropagation(); // else it would close the dialog
    this.#field.value = "";
    this.#search();
  }

  /** Do an entry, unless it cannot be done now: its row says why. */
  #do(entry) {
    if (!entry || entry.why?.()) return;
    this.#dialog.close();
    entry.act();
  }
}
