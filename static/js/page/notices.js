/** Results of a person's input: shown once at the edge of the screen, and kept in a log. */

import { timeText } from "../formats/times.js";
import { closable } from "../lib/dialog.js";
import { make, makeButton, mark, setText } from "../lib/dom.js";
import { SearchList } from "../lib/list.js";

const SHOWN_MS = 5000;
const SHOWN_AT_MOST = 3;
const SHOWN_WHERE_SMALL = 1; // more would cover the picture
const SMALL = "(max-width: 68.6875em), (max-height: 39.9375em)";
const KEPT = 100;
// By then a screen reader has the text; the copy is removed, so that it is not found twice.
const ANNOUNCED_MS = 1500;
const LEAST_MS = 1000; // shown at least this long after the pointer or the focus left

/** Icon and word of each level: a level is never shown by colour alone. */
function levels() {
  return {
    success: { icon: "✓", word: gettext("Done") },
    info: { icon: "i", word: gettext("Note") },
    warning: { icon: "!", word: gettext("Warning") },
    error: { icon: "✕", word: gettext("Error") },
  };
}

/** Return the icon and the words of a notice. @param {HTMLElement} said the notice's text */
function words(level, said) {
  const { icon, word } = levels()[level];
  const sign = make("span", { className: "notice-icon", text: icon });
  sign.setAttribute("aria-hidden", "true");
  const strong = make("strong", { className: "notice-word", text: word });
  return [sign, make("p", { children: [strong, " ", said] })];
}

/** An entry of the log. */
function logRow({ level, text, times, at }) {
  const time = make("time", { text: timeText(at) });
  time.dateTime = at.toISOString();
  const count = make("span", { className: "notice-times", text: timesText(times) });
  return make("div", {
    className: "notice",
    data: { level },
    children: [...words(level, make("span", { text })), count, time],
  });
}

function timesText(times) {
  return times > 1 ? `×${times}` : "";
}

/** One notice on the page: disappears after some seconds, but not while it has the pointer or the focus. */
class Shown {
  element;
  #text;
  #times;
  #bar = make("span", { className: "notice-bar" });
  #timer = null;
  #leftMs = SHOWN_MS;
  #sinceMs = 0;
  #holders = new Set();
  #ended;

  /** @param {(hadFocus: boolean) => void} ended is called once */
  constructor(entry, ended) {
    this.#ended = ended;
    this.#text = make("span");
    this.#times = make("span", { className: "notice-times" });
    const close = makeButton({ className: "close", text: "×" }, () => this.end());
    close.setAttribute("aria-label", gettext("Dismiss"));
    this.element = make("li", {
      className: "notice",
      data: { level: entry.level },
      children: [...words(entry.level, this.#text), this.#times, close, this.#bar],
    });
    for (const [type, holder, holds] of [
      ["pointerenter", "pointer", true],
      ["pointerleave", "pointer", false],
      ["focusin", "focus", true],
      ["focusout", "focus", false],
    ])
      this.element.addEventListener(type, () => this.#hold(holder, holds));
    this.update(entry);
  }

  update({ short, times }) {
    setText(this.#text, short); // the log shows the full text
    setText(this.#times, timesText(times));
    this.#leftMs = SHOWN_MS;
    this.#bar.remove();
    this.element.append(this.#bar); // a new element restarts the animation
    if (!this.held) this.#run();
  }

  /** Return whether the pointer or the focus is on the notice. */
  get held() {
    return this.#holders.size > 0;
  }

  end() {
    clearTimeout(this.#timer);
    if (!this.element.parentNode) return; // removing an element also fires its focus event
    const hadFocus = this.element.contains(document.activeElement);
    this.element.remove();
    this.#ended(hadFocus);
  }

  #run() {
    clearTimeout(this.#timer);
    this.#sinceMs = performance.now();
    this.#timer = setTimeout(() => this.end(), this.#leftMs);
  }

  #hold(holder, holds) {
    const before = this.held;
    if (holds) this.#holders.add(holder);
    else this.#holders.delete(holder);
    if (this.held === before) return;
    mark(this.element, "held", this.held);
    if (!this.held) return this.#run();
    clearTimeout(this.#timer);
    this.#leftMs = Math.max(this.#leftMs - (performance.now() - this.#sinceMs), LEAST_MS);
  }
}

export class Notices {
  #parts;
  #shown = new Map();
  #log = [];
  #list;
  #announced = new Map(); // timers that remove the texts for screen readers, by key
  #cameFrom = null; // the element that had the focus before the notices got it
  #listening = new AbortController();

  /**
   * @param {{notices, said, alarm, "log-open", "log-dialog", "log-list"}} parts `said` and `alarm` are live
   *   regions, polite and assertive, that only screen readers see
   */
  constructor(parts) {
    this.#parts = parts;
    this.#list = new SearchList(parts["log-list"], {
      label: gettext("Search notices"),
      text: ({ level, text, at }) => [levels()[level].word, text, timeText(at)].join(" "),
      row: logRow,
    });
    this.#list.empty = gettext("There were none since this page was opened.");
    const { signal } = this.#listening;
    parts["log-open"].addEventListener("click", () => this.#openLog(), { signal });
    closable(parts["log-dialog"], signal);
    const came = ({ relatedTarget }) => {
      if (relatedTarget && !parts.notices.contains(relatedTarget)) this.#cameFrom = relatedTarget;
    };
    parts.notices.addEventListener("focusin", came, { signal });
  }

  /**
   * @param {object} notice
   * @param {"success" | "info" | "warning" | "error"} notice.level
   * @param {string} notice.code the subject: while a notice of this level and code is shown, another one
   *   only raises its count
   * @param {string} [notice.short] a text without technical names, shown in place of `text`
   * @param {boolean} [notice.quiet] the page already shows this: the notice is only logged, and read by
   *   screen readers
   */
  add({ level, code, text, short = text, quiet = false }) {
    const key = `${level} ${code}`;
    const before = this.#shown.get(key);
    const entry = before?.entry ?? { level, times: 0 };
    Object.assign(entry, { text, short, times: entry.times + 1, at: new Date() });
    if (before) before.item.update(entry);
    else if (!quiet) this.#begin(key, entry);
    this.#announce(key, entry);
    this.#log = [entry, ...this.#log.filter((other) => other !== entry)].slice(0, KEPT);
    if (this.#parts["log-dialog"].open) this.#list.items = this.#log;
  }

  close() {
    for (const { item } of [...this.#shown.values()]) item.end();
    for (const timer of this.#announced.values()) clearTimeout(timer);
    this.#listening.abort();
    this.#list.close();
  }

  #begin(key, entry) {
    const most = matchMedia(SMALL).matches ? SHOWN_WHERE_SMALL : SHOWN_AT_MOST;
    if (this.#shown.size >= most) this.#oldest.end();
    const item = new Shown(entry, (hadFocus) => this.#ended(key, hadFocus));
    this.#shown.set(key, { item, entry });
    this.#parts.notices.prepend(item.element);
  }

  /** Move the focus to the next notice, or back to the element that had it before the notices. */
  #ended(key, hadFocus) {
    this.#shown.delete(key);
    if (hadFocus) (this.#parts.notices.querySelector(".close") ?? this.#cameFrom)?.focus();
  }

  /** The notice to remove first: the oldest without pointer and focus; if there is none, the oldest. */
  get #oldest() {
    const items = [...this.#shown.values()].map(({ item }) => item);
    return items.find(({ held }) => !held) ?? items[0];
  }

  /**
   * Announce a notice in its own element, so that it does not interrupt another. Repeats are announced once.
   */
  #announce(key, { level, short: text }) {
    const { alarm, said } = this.#parts;
    const region = level === "error" ? alarm : said;
    if (this.#announced.has(key)) clearTimeout(this.#announced.get(key));
    else region.append(make("p", { text: `${levels()[level].word}: ${text}`, data: { key } }));
    const forget = () => {
      this.#announced.delete(key);
      [...region.children].find((announced) => announced.dataset.key === key)?.remove();
    };
    this.#announced.set(key, setTimeout(forget, ANNOUNCED_MS));
  }

  #openLog() {
    this.#list.clear();
    this.#list.items = this.#log;
    this.#parts["log-dialog"].show();
  }
}
