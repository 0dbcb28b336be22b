/** Ready-made messages, each in its own script: a press and the robot says it. */

import { dim, make, say, show } from "./dom.js";
import { inLanguage, languageName } from "./languages.js";
import { SearchList } from "./list.js";
import { readJson } from "./read.js";

export class Phrases {
  #parts;
  #url;
  #list;
  #mayAct = false;

  /**
   * @param {Record<string, HTMLElement>} parts
   * @param {string} url where they are read
   * @param {(order: object) => void} send
   */
  constructor(parts, url, send) {
    this.#parts = parts;
    this.#url = url;
    this.#list = new SearchList(parts["phrase-list"], {
      label: gettext("Search phrases"),
      text: ({ text, language, tags = [] }) => [text, languageName(language), ...tags].join(" "),
      group: ({ language }) => languageName(language),
      row: (phrase) => row(phrase, send),
      act: () => {},
    });
  }

  /** @param {boolean} may this tab has control */
  set mayAct(may) {
    this.#mayAct = may;
    this.#enable();
  }

  /** Reads them from the console. */
  async load() {
    const failed = gettext("The phrases could not be read. Load the page again.");
    try {
      this.#show(byLanguage(await readJson(this.#url, failed)));
    } catch (error) {
      this.#say(error.message);
    }
  }

  /** Forgets the search: not every tab shows its field. */
  showAll() {
    this.#list.clear();
  }

  close() {
    this.#list.close();
  }

  #show(phrases) {
    this.#list.items = phrases;
    this.#say(phrases.length ? "" : gettext("There are no phrases for this robot yet."));
    this.#enable();
  }

  #enable() {
    for (const button of this.#parts["phrase-list"].querySelectorAll("button"))
      dim(button, !this.#mayAct);
  }

  #say(text) {
    say(this.#parts["phrases-none"], text);
    show(this.#parts["phrases-none"], text !== "");
  }
}

/** Phrases of one language stand together; the languages and what is in them keep their order. */
export function byLanguage(phrases) {
  const languages = [...new Set(phrases.map(({ language }) => language))];
  return languages.flatMap((own) => phrases.filter(({ language }) => language === own));
}

function row({ text, language }, send) {
  const words = make("span", { className: "hit-name", text });
  const button = inLanguage(make("button", { className: "hit", children: [words] }), language);
  button.type = "button";
  button.addEventListener("click", () => send({ t: "say", text, language }));
  return button;
}
