/** What this robot was made to say, newest first, from the audit record; each can be repeated as it was. */

import { dim, make, mark, say, show } from "./dom.js";
import { inLanguage, languageName } from "./languages.js";
import { SearchList } from "./list.js";

const PAGE = 50;

/** How a speech ended, in a word or two. */
export function outcomeText(outcome) {
  const texts = {
    done: gettext("done"),
    sent: gettext("sent"),
    cancelled: gettext("cancelled"),
    rejected: gettext("not accepted"),
    failed: gettext("failed"),
    stopped: gettext("stopped"),
    unheard: gettext("not heard of again"),
    unknown: gettext("end not known"),
  };
  return texts[outcome] ?? outcome ?? gettext("not over yet");
}

/** The time if it was today, else the day and the time; with the zone, for the records of the same are in UTC. */
export function whenText(at, now = new Date()) {
  const when = new Date(at);
  const day = { year: "numeric", month: "short", day: "numeric" };
  const time = { hour: "2-digit", minute: "2-digit", timeZoneName: "short" };
  const options = when.toDateString() === now.toDateString() ? time : { ...day, ...time };
  return new Intl.DateTimeFormat(document.documentElement.lang || "en", options).format(when);
}

export class History {
  #parts;
  #url;
  #send;
  #list;
  #entries = [];
  #topic = null;
  #mayAct = false;
  #listening = new AbortController();

  /**
   * @param {Record<string, HTMLElement>} parts
   * @param {string} url where it is read
   * @param {(order: object) => void} send
   */
  constructor(parts, url, send) {
    this.#parts = parts;
    this.#url = url;
    this.#send = send;
    this.#list = new SearchList(parts["history-list"], {
      label: gettext("Search history"),
      text: ({ text, language, topic, who }) =>
        [text, languageName(language), topic, who].join(" "),
      row: (entry) => this.#row(entry),
      act: () => {},
    });
    parts["history-more"].addEventListener("click", () => this.#more(), {
      signal: this.#listening.signal,
    });
  }

  /** @param {boolean} may this tab has control */
  set mayAct(may) {
    this.#mayAct = may;
    this.#enable();
  }

  /** @param {?string} topic where speech goes now: its entries are marked */
  set topic(topic) {
    if (topic === this.#topic) return;
    this.#topic = topic;
    this.#list.items = this.#entries;
    this.#enable();
  }

  /** Reads the newest. */
  load() {
    return this.#read("", (entries) => entries);
  }

  close() {
    this.#listening.abort();
    this.#list.close();
  }

  #more() {
    const { number } = this.#entries.at(-1);
    return this.#read(`&before=${number}`, (older) => [...this.#entries, ...older]);
  }

  async #read(query, merged) {
    try {
      const answer = await fetch(`${this.#url}?limit=${PAGE}${query}`, {
        headers: { Accept: "application/json" },
      });
      if (!answer.ok) throw new Error(gettext("The history could not be read."));
      const { entries, more } = await answer.json();
      this.#entries = merged(entries);
      this.#list.items = this.#entries;
      this.#enable();
      show(this.#parts["history-more"], more);
      this.#say(this.#entries.length ? "" : gettext("Nothing was said yet."));
    } catch (error) {
      this.#say(error.message);
    }
  }

  #row({ text, language, topic, who, at, outcome, why }) {
    const isHere = topic === this.#topic;
    const time = make("time", { text: whenText(at) });
    time.dateTime = at;
    const facts = [languageName(language), topic, who, outcomeText(outcome)].filter(Boolean);
    const note = make("span", {
      className: "hit-note",
      children: [time, ` · ${facts.join(" · ")}`],
    });
    if (why) note.title = why;
    const said = text
      ? inLanguage(make("span", { className: "hit-name", text }), language)
      : make("span", { className: "hit-name quiet", text: gettext("text expired") });
    const words = make("span", { className: "hit-words", children: [said, note] });
    const again = make("button", { className: "button", text: gettext("Repeat") });
    again.type = "button";
    again.addEventListener("click", () =>
      this.#send({ t: "say", text, language, topic: topic || null }),
    );
    const mine = make("span", { className: "badge", text: gettext("this topic") });
    const children = [words, isHere && mine, text && again].filter(Boolean);
    const row = make("div", { className: "hit", children });
    mark(row, "here", isHere);
    return row;
  }

  #enable() {
    for (const button of this.#parts["history-list"].querySelectorAll("button"))
      dim(button, !this.#mayAct);
  }

  #say(text) {
    say(this.#parts["history-none"], text);
    show(this.#parts["history-none"], text !== "");
  }
}
