/** Speech: a free text in a chosen language. */

import { whyNotNow } from "../control/lease.js";
import { inLanguage, isolated, languageChoices, languageName } from "../formats/languages.js";
import { dim, mark, setText, setTextOrHide, show } from "../lib/dom.js";
import { SearchList } from "../lib/list.js";
import { recall, remember } from "../lib/prefs.js";
import { limits } from "./lesson_tasks.js";
import { SpeechLine } from "./speech_line.js";
import { Endings, levelOf } from "./task_ends.js";
import { shortened } from "./tasks.js";

const LONGEST = 500; // characters
const LANGUAGE = "language";
const UNSPEAKABLE = /(?![\n\t])[\p{Cc}\p{Cs}]/u;
const HEARD = /[^\p{C}\p{Z}\s]/u;

/** Return the number of characters (code points) of a text. The robot's side counts the same way. */
function lengthOf(text) {
  return Array.from(text).length;
}

/** Remove the full stop after a quotation that ends with its own full stop. */
function endedOnce(sentence) {
  return sentence.replace(/([\p{Sentence_Terminal}…]\p{P}*\p{Cf}*”)\.$/u, "$1");
}

/** Notice of a speech's end. */
export function speechEndNotice({ outcome, text: why }, text) {
  const outcomes = {
    done: gettext("Said: “%s”."),
    sent: gettext("Sent: “%s”. This robot does not report when it has spoken."),
    cancelled: gettext("Cancelled: “%s”."),
    rejected: gettext("The robot did not accept “%s”."),
    failed: gettext("The robot failed to say “%s”."),
    stopped: gettext("Ended by the stop: “%s”."),
    unheard: gettext("The robot did not report the end of “%s”."),
  };
  const words = outcomes[outcome] ?? `${outcome}: “%s”.`;
  const said = endedOnce(interpolate(words, [isolated(shortened(text))]));
  return {
    level: levelOf(outcome),
    code: `speech ${outcome} ${text}`,
    text: why && outcome !== "done" && outcome !== "sent" ? `${said} ${why}` : said,
  };
}

function statusText(status) {
  const texts = {
    sent: gettext("Sent"),
    accepted: gettext("Accepted"),
    speaking: gettext("Speaking"),
  };
  return texts[status] ?? status;
}

/** Return the reason why the robot cannot speak now; empty if it can. @param {object} offers of the robot */
export function muteText({ uses = {} }) {
  return uses.speech ? (uses.speech.refusal?.text ?? "") : gettext("This robot has no voice.");
}

/** The form: text, language, and the number of characters. */
export class Say {
  static hears = ["offers", "tasks", "state.speech", "mayAct"];
  static task = "speech";
  static requests = {
    say: { name: ({ text }) => interpolate(gettext("Say “%s”"), [isolated(shortened(text))]) },
    say_cancel: { name: () => gettext("Cancel speech"), control: "optional" },
  };
  line = new SpeechLine();
  #parts;
  #send;
  #list;
  #ends;
  #language = recall(LANGUAGE, null);
  #own = [];
  #mayAct = null; // whether this tab has control; null: not known yet
  #mute = ""; // why the robot cannot speak
  #offers = null;
  #tasks = null;
  #isSending = false;
  #listening = new AbortController();

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ parts, request: send, notify }) {
    this.#parts = parts;
    this.#send = send;
    this.#ends = new Endings((ended, text) => notify(speechEndNotice(ended, text)));
    this.#list = new SearchList(parts["language-list"], {
      label: gettext("Search languages"),
      text: ({ name, code }) => `${name} ${code} ${languageName(code, code)}`,
      group: ({ own }) => (own ? gettext("This robot’s") : gettext("Others")),
      note: ({ code }) => code,
      act: ({ code }) => this.#choose(code),
    });
    const { signal } = this.#listening;
    const on = (part, type, act) => parts[part].addEventListener(type, act, { signal });
    on("say-text", "input", () => this.#typed());
    on("say-text", "keydown", (event) => this.#key(event));
    on("say-form", "submit", (event) => this.#submit(event));
    on("language", "click", () => this.#open(parts["language-box"].hidden));
    on("language-box", "keydown", ({ key }) => key === "Escape" && this.#closeLanguages());
    this.#showLanguage();
    this.#count();
  }

  /** @param {object} offers of the robot; the preferred one of its languages is the first */
  set offers(offers) {
    const { languages = [] } = offers;
    this.#offers = offers;
    this.#listen();
    if (languages.join() === this.#own.join()) return;
    this.#own = languages;
    this.#list.items = [];
    this.#showLanguage();
  }

  /** @param {?object} tasks that the present lesson leaves; null: all */
  set tasks(tasks) {
    this.#tasks = tasks;
    if (this.#offers) this.#listen();
  }

  #listen() {
    const only = gettext("In this lesson the robot says only the phrases of the list.");
    this.#mute = muteText(this.#offers) || (limits(this.#tasks, "phrases") ? only : "");
    this.#hint();
  }

  /** @param {{now: ?object, ended: ?object}} speech of the robot */
  set speech({ now, ended }) {
    this.#ends.follow(now?.text ?? null, ended);
  }

  /** @param {?boolean} may whether this tab has control; null: not known yet */
  set mayAct(may) {
    this.#mayAct = may;
    this.#hint();
  }

  get language() {
    return this.#language ?? this.#own[0] ?? "en-GB";
  }

  shows({ now }) {
    return now && { words: statusText(now.status), who: now.who, cancel: [{ t: "say_cancel" }] };
  }

  sent({ t, text }) {
    return this.#ends.begin(text, t === "say_cancel");
  }

  silent() {
    this.#ends.lost();
  }

  close() {
    this.#listening.abort();
    this.#list.close();
  }

  // --- language --------------------------------------------------------------------------------

  #open(open) {
    if (open && this.#list.items.length === 0) this.#list.items = languageChoices(this.#own);
    show(this.#parts["language-box"], open);
    this.#parts.language.setAttribute("aria-expanded", String(open));
    if (!open) return;
    this.#list.focus();
    // On a phone the hits are below the edge of the screen.
    this.#parts["language-box"].scrollIntoView({ block: "nearest" });
  }

  #closeLanguages() {
    this.#open(false);
    this.#parts.language.focus();
  }

  #choose(code) {
    this.#language = code;
    remember(LANGUAGE, code);
    this.#showLanguage();
    this.#open(false);
    this.#parts["say-text"].focus();
  }

  #showLanguage() {
    setText(this.#parts["language-name"], languageName(this.language));
    inLanguage(this.#parts["say-text"], this.language);
  }

  // --- text ------------------------------------------------------------------------------------

  /** Show the reason why the robot cannot speak at all. */
  #hint() {
    const takeControl = this.#mayAct === false ? whyNotNow() : "";
    setTextOrHide(this.#parts["say-hint"], this.#mute || takeControl);
    this.#count();
  }

  #typed() {
    this.#showText("");
    this.#count();
  }

  #count() {
    const length = lengthOf(this.#parts["say-text"].value.trim());
    const { "say-count": count, "say-send": send } = this.#parts;
    setText(count, `${length} / ${LONGEST}`);
    mark(count, "over", length > LONGEST);
    const mayNot = !this.#mayAct || this.#mute !== "";
    dim(send, mayNot || length > LONGEST, mayNot ? this.#mute || whyNotNow() : "");
  }

  /**
   * Enter sends; Shift and Enter break the line. While a character (an accent, a syllable) is composed, Enter
   * does not send.
   */
  #key(event) {
    if (event.key !== "Enter" || event.shiftKey || event.isComposing) return;
    event.preventDefault();
    this.#parts["say-form"].requestSubmit();
  }

  /** Enter pressed twice or held down sends the text once. A refusal is shown like every outcome. */
  async #submit(event) {
    event.preventDefault();
    if (this.#isSending) return;
    const field = this.#parts["say-text"];
    const text = field.value.trim();
    const fault = this.#fault(text);
    this.#showText(fault);
    if (fault) return;
    this.#isSending = true;
    const refusal = await this.#send({ t: "say", text, language: this.language });
    this.#isSending = false;
    if (!refusal && field.value.trim() === text) this.#clear();
  }

  #fault(text) {
    const unspeakable = UNSPEAKABLE.exec(text);
    if (unspeakable) return this.#pointOut(text, unspeakable);
    if (!HEARD.test(text)) return gettext("Write what the robot should say.");
    if (this.#mute) return this.#mute;
    if (!this.#mayAct) return gettext("Take control first: then the robot can speak.");
    if (lengthOf(text) > LONGEST)
      return interpolate(gettext("At most %s characters: shorten it."), [LONGEST]);
    return "";
  }

  /** Select an invisible character, so that one key deletes it, and return the reason. */
  #pointOut(text, { 0: character, index }) {
    const field = this.#parts["say-text"];
    const start = field.value.indexOf(text) + index;
    field.focus();
    field.setSelectionRange(start, start + character.length);
    const code = character.codePointAt(0).toString(16).toUpperCase().padStart(4, "0");
    const place = lengthOf(text.slice(0, index)) + 1;
    const words = gettext("Character %(place)s (U+%(code)s) cannot be spoken: delete it.");
    return interpolate(words, { place, code }, true);
  }

  #clear() {
    this.#parts["say-text"].value = "";
    this.#count();
  }

  #showText(text) {
    setTextOrHide(this.#parts["say-fault"], text);
    this.#parts["say-text"].setAttribute("aria-invalid", String(text !== ""));
  }
}
