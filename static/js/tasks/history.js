/** This robot's spoken texts that the person may read, newest first; each can be repeated. */

import { readJson } from "../connection/read.js";
import { whyNotNow } from "../control/lease.js";
import { inLanguage, languageName } from "../formats/languages.js";
import { whenText } from "../formats/times.js";
import { make, makeButton, mark, setTextOrHide, show } from "../lib/dom.js";
import { SearchList } from "../lib/list.js";

const PAGE = 50;

/** End of a speech, in a word or two. */
export function outcomeText(outcome) {
  const texts = {
    done: gettext("done"),
    sent: gettext("sent"),
    cancelled: gettext("cancelled"),
    rejected: gettext("not accepted"),
    failed: gettext("failed"),
    stopped: gettext("stopped"),
    unheard: gettext("end not reported"),
    unknown: gettext("end not known"),
  };
  return texts[outcome] ?? outcome ?? gettext("not over yet");
}

export class History {
  static hears = ["offers", "state.speech", "state.chosen", "mayAct", "tab"];
  #parts;
  #url;
  #send;
  #list;
  #entries = [];
  #uses = {};
  #chosen = {};
  #topic = null; // to which speech goes now: entries of this topic are marked
  #saying = null; // number of the current speech
  #ended = null; // the last ended speech: the robot may report its end before the record has it
  #newest = "";
  #isShown = false;
  #reading = Promise.resolve();
  #listening = new AbortController();

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ root, parts, request: send }) {
    this.#parts = parts;
    this.#url = root.dataset.speech;
    this.#send = send;
    this.#list = new SearchList(parts["history-list"], {
      label: gettext("Search history"),
      text: ({ text, language, topic, who }) =>
        [text, languageName(language), topic, who].join(" "),
      key: ({ number }) => number,
      row: (entry) => this.#row(entry),
    });
    parts["history-more"].addEventListener("click", () => this.#more(), {
      signal: this.#listening.signal,
    });
  }

  /** @param {?boolean} may whether this tab has control; null: not known yet */
  set mayAct(may) {
    this.#list.dim(!may, whyNotNow());
  }

  /** @param {object} offers of the robot */
  set offers({ uses = {} }) {
    this.#uses = uses;
    this.#markTopic();
  }

  /** @param {Object<string, string>} chosen topics by use, where they are not the default */
  set chosen(chosen) {
    this.#chosen = chosen;
    this.#markTopic();
  }

  /** @param {string} tab that is shown */
  set tab(tab) {
    this.#isShown = tab === "speech";
    if (this.#isShown) this.load();
  }

  /** @param {{now: ?object, ended: ?object}} speech of the robot */
  set speech({ now, ended }) {
    const newest = `${now?.number} ${ended?.number}`;
    if (newest === this.#newest) return;
    this.#newest = newest;
    this.#saying = now?.number ?? null;
    this.#ended = ended;
    if (this.#isShown) this.load();
  }

  /** Reads the newest entries. Older entries that were loaded stay. */
  load() {
    return this.#read(
      () => "",
      ({ entries, more }) => {
        const last = entries.at(-1)?.number ?? 0;
        const older = this.#entries.filter(({ number }) => number < last);
        const isNext = older.length < this.#entries.length; // nothing is missing in between
        if (!isNext || older.length === 0) show(this.#parts["history-more"], more);
        this.#entries = isNext ? [...entries, ...older] : entries;
      },
    );
  }

  close() {
    this.#listening.abort();
    this.#list.close();
  }

  #markTopic() {
    const topic = this.#chosen.speech ?? this.#uses.speech?.topic ?? null;
    if (topic === this.#topic) return;
    this.#topic = topic;
    this.#show();
  }

  #more() {
    return this.#read(
      () => `&before=${this.#entries.at(-1).number}`,
      ({ entries, more }) => {
        this.#entries = [...this.#entries, ...entries];
        show(this.#parts["history-more"], more);
      },
    );
  }

  /** Read one after another, so that an older answer never replaces a newer one. */
  #read(query, take) {
    this.#reading = this.#reading.then(() => this.#readNow(query, take));
    return this.#reading;
  }

  async #readNow(query, take) {
    const failed = gettext("The history could not be read.");
    try {
      take(await readJson(`${this.#url}?limit=${PAGE}${query()}`, failed));
      this.#show();
      this.#showText(this.#entries.length ? "" : gettext("Nothing to show yet."));
    } catch (error) {
      this.#showText(error.message);
    }
  }

  #show() {
    this.#list.items = this.#entries;
  }

  /** Return the end of a speech, from the record or else from the robot; outcome null: it still runs. */
  #endOf({ number, outcome, why }) {
    if (outcome !== null) return { outcome, why };
    if (number === this.#ended?.number)
      return { outcome: this.#ended.outcome, why: this.#ended.text };
    return { outcome: number === this.#saying ? null : "unknown", why };
  }

  #row(entry) {
    const { text, language, topic, who, at } = entry;
    const { outcome, why } = this.#endOf(entry);
    const isHere = topic === this.#topic;
    const time = make("time", { text: whenText(at) });
    time.dateTime = at;
    const facts = [languageName(language), topic, who, outcomeText(outcome)].filter(Boolean);
    const mine = make("span", { className: "badge", text: gettext("this topic") });
    const note = make("span", {
      className: "hit-note",
      children: [time, ` · ${facts.join(" · ")} `, isHere && mine].filter(Boolean),
    });
    if (why) note.title = why;
    const said = text
      ? inLanguage(make("span", { className: "hit-name", text }), language)
      : make("span", { className: "hit-name quiet", text: gettext("text expired") });
    const words = make("span", { className: "hit-words", children: [said, note] });
    const again = makeButton({ className: "button", text: gettext("Repeat") }, () =>
      this.#send({ t: "say", text, language, topic: topic || null }),
    );
    const children = [words, text && again].filter(Boolean);
    const row = make("div", { className: "hit", children });
    mark(row, "here", isHere);
    return row;
  }

  #showText(text) {
    setTextOrHide(this.#parts["history-none"], text);
  }
}
