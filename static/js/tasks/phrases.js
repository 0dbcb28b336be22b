/**
 * Ready-made texts, each in its own language, those in the page's language first: a press makes the robot speak the
 * text.
 */

import { readJson } from "../connection/read.js";
import { whyNotNow } from "../control/lease.js";
import { inLanguage, languageName, pageLanguage } from "../formats/languages.js";
import { make, makeButton, mark, setTextOrHide } from "../lib/dom.js";
import { SearchList } from "../lib/list.js";
import { leftOf } from "./lesson_tasks.js";
import { muteText } from "./say.js";

export class Phrases {
  static hears = ["offers", "tasks", "mayAct", "tab"];
  #parts;
  #url;
  #list;
  #mayAct = null;
  #mute = "";
  #none = "";
  #phrases = [];
  #tasks = null;

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ root, parts, request }) {
    this.#parts = parts;
    this.#url = root.dataset.phrases;
    this.#list = new SearchList(parts["phrase-list"], {
      label: gettext("Search phrases"),
      text: ({ text, language, tags = [] }) => [text, languageName(language), ...tags].join(" "),
      group: ({ language }) => languageName(language),
      row: (phrase) => row(phrase, request),
    });
    this.load();
  }

  /** @param {?boolean} may whether this tab has control; null: not known yet */
  set mayAct(may) {
    this.#mayAct = may;
    this.#update();
  }

  /** @param {object} offers of the robot */
  set offers(offers) {
    this.#mute = muteText(offers);
    this.#update();
  }

  /** @param {?object} tasks that the present lesson leaves; null: all */
  set tasks(tasks) {
    this.#tasks = tasks;
    this.#show(this.#phrases);
  }

  /** Reads the phrases from the console. */
  async load() {
    const failed = gettext("The phrases could not be read. Load the page again.");
    try {
      this.#show((await readJson(this.#url, failed)).phrases);
    } catch (error) {
      this.#showText(error.message);
    }
  }

  /** Another tab is shown: clear the search, whose field is not visible on every tab. */
  set tab(_) {
    this.#list.clear();
  }

  close() {
    this.#list.close();
  }

  #show(phrases) {
    this.#phrases = phrases;
    const isOwn = ({ language }) => baseOf(language) === baseOf(pageLanguage());
    const left = leftOf(this.#tasks, "phrases", phrases, ({ text }) => text);
    this.#list.items = [...left].sort((one, other) => isOwn(other) - isOwn(one));
    this.#showText(phrases.length ? "" : gettext("There are no phrases for this robot yet."));
  }

  /** @param {string} text why there are no phrases */
  #showText(text) {
    this.#none = text;
    this.#update();
  }

  #update() {
    this.#list.dim(!this.#mayAct || this.#mute !== "", this.#mute || whyNotNow());
    const { "phrases-none": words } = this.#parts;
    setTextOrHide(words, this.#none || this.#mute);
    mark(words, "mute", this.#none === ""); // hidden where the form for a free text already gives the reason
  }
}

/** "es" of "es-ES". */
const baseOf = (code) => code.split("-")[0].toLowerCase();

function row({ text, language }, send) {
  const words = make("span", { className: "hit-name", text });
  const button = makeButton({ className: "hit", children: [words] }, () =>
    send({ t: "say", text, language }),
  );
  return inLanguage(button, language);
}
