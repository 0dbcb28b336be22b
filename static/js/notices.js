/** What came of a person's input: told once at the edge of the screen, and kept in a log. */

import { closable } from "./dialog.js";
import { make, say, show } from "./dom.js";

const SHOWN_MS = 5000;
const SHOWN_AT_MOST = 4;
const KEPT = 100;
const ANNOUNCED_MS = 1500; // then a screen reader has it, and finds it on the page once

/** Never by colour alone. */
function levels() {
  return {
    success: { icon: "✓", word: gettext("Done") },
    info: { icon: "i", word: gettext("Note") },
    warning: { icon: "!", word: gettext("Warning") },
    error: { icon: "✕", word: gettext("Error") },
  };
}

/** Sign and words. @param {HTMLElement} said what is told */
function words(level, said) {
  const { icon, word } = levels()[level];
  const sign = make("span", { className: "notice-icon", text: icon });
  sign.setAttribute("aria-hidden", "true");
  const strong = make("strong", { className: "notice-word", text: word });
  return [sign, make("p", { children: [strong, " ", said] })];
}

/** This browser's time of day; with its zone, for the records of the same are in UTC. */
function timeText(at) {
  const options = { hour: "2-digit", minute: "2-digit", second: "2-digit", timeZoneName: "short" };
  return at.toLocaleTimeString(document.documentElement.lang || "en", options);
}

function timesText(times) {
  return times > 1 ? `×${times}` : "";
}

/** One notice on the page: leaves by itself, stays under the pointer and the focus. */
class Shown {
  element;
  #text;
  #times;
  #bar = make("span", { className: "notice-bar" });
  #timer = null;
  #leftMs = SHOWN_MS;
  #sinceMs = 0;
  #ended;

  constructor(entry, ended) {
    this.#ended = ended;
    this.#text = make("span");
    this.#times = make("span", { className: "notice-times" });
    const close = make("button", { className: "close", text: "×" });
    close.type = "button";
    close.setAttribute("aria-label", gettext("Dismiss"));
    close.addEventListener("click", () => this.end());
    this.element = make("li", {
      className: "notice",
      data: { level: entry.level },
      children: [...words(entry.level, this.#text), this.#times, close, this.#bar],
    });
    for (const [type, act] of [
      ["pointerenter", () => this.#hold()],
      ["focusin", () => this.#hold()],
      ["pointerleave", () => this.#run()],
      ["focusout", () => this.#run()],
    ])
      this.element.addEventListener(type, act);
    this.update(entry);
  }

  update({ text, times }) {
    say(this.#text, text);
    say(this.#times, timesText(times));
    this.#leftMs = SHOWN_MS;
    this.#bar.remove();
    this.element.append(this.#bar); // an animation begins anew with its element
    if (!this.held) this.#run();
  }

  /** Whether the pointer or the focus is on it. */
  get held() {
    return "held" in this.element.dataset;
  }

  end() {
    clearTimeout(this.#timer);
    this.element.remove();
    this.#ended();
  }

  #run() {
    clearTimeout(this.#timer);
    this.#sinceMs = performance.now();
    this.#timer = setTimeout(() => this.end(), this.#leftMs);
    delete this.element.dataset.held;
  }

  #hold() {
    clearTimeout(this.#timer);
    this.#leftMs = Math.max(this.#leftMs - (performance.now() - this.#sinceMs), 1000);
    this.element.dataset.held = "true";
  }
}

export class Notices {
  #parts;
  #shown = new Map();
  #log = [];
  #timer = null;
  #listening = new AbortController();

  /**
   * @param {{notices, said, alarm, "log-open", "log-dialog", "log-list", "log-none"}} parts `said` and `alarm` are live
   *   regions, polite and assertive, that only screen readers see
   */
  constructor(parts) {
    this.#parts = parts;
    const { signal } = this.#listening;
    parts["log-open"].addEventListener("click", () => this.#openLog(), { signal });
    closable(parts["log-dialog"], signal);
  }

  /**
   * @param {object} notice
   * @param {"success" | "info" | "warning" | "error"} notice.level
   * @param {string} notice.code what it is about: the same while one is shown is one, counted
   */
  add({ level, code, text }) {
    const key = `${level} ${code}`;
    const before = this.#shown.get(key);
    if (before) {
      before.entry.times += 1;
      before.entry.text = text;
      before.entry.at = new Date();
      before.item.update(before.entry);
      if (level === "error") this.#announce(before.entry);
    } else {
      this.#begin(key, { level, text, times: 1, at: new Date() });
    }
    if (this.#parts["log-dialog"].open) this.#fillLog();
  }

  close() {
    for (const { item } of [...this.#shown.values()]) item.end();
    clearTimeout(this.#timer);
    this.#listening.abort();
  }

  #begin(key, entry) {
    if (this.#shown.size >= SHOWN_AT_MOST) this.#oldest.end();
    const item = new Shown(entry, () => this.#shown.delete(key));
    this.#shown.set(key, { item, entry });
    this.#parts.notices.prepend(item.element);
    this.#announce(entry);
    this.#log.unshift(entry);
    this.#log.length = Math.min(this.#log.length, KEPT);
  }

  /** The first to give way: not the one that somebody is reading, unless all are. */
  get #oldest() {
    const items = [...this.#shown.values()].map(({ item }) => item);
    return items.find(({ held }) => !held) ?? items[0];
  }

  #announce({ level, text }) {
    const { alarm, said } = this.#parts;
    say(level === "error" ? alarm : said, `${levels()[level].word}: ${text}`);
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => {
      say(alarm, "");
      say(said, "");
    }, ANNOUNCED_MS);
  }

  #openLog() {
    this.#fillLog();
    this.#parts["log-dialog"].show();
  }

  #fillLog() {
    const rows = this.#log.map(({ level, text, times, at }) => {
      const time = make("time", { text: timeText(at) });
      time.dateTime = at.toISOString();
      const count = make("span", { className: "notice-times", text: timesText(times) });
      return make("li", {
        className: "notice",
        data: { level },
        children: [...words(level, make("span", { text })), count, time],
      });
    });
    this.#parts["log-list"].replaceChildren(...rows);
    show(this.#parts["log-none"], rows.length === 0);
  }
}
