/** The place for the reason: the most important one with its button, and the number of the others. */

import { Announcer } from "../../lib/announce.js";
import { mark, setText, setTextOrHide, show } from "../../lib/dom.js";
import { heldOnce, TWO_TAPS_MS } from "../../lib/presses.js";

const MOVING = new Set(["back_off", "turn", "look", "arm_home"]);

function labelOf(act) {
  return {
    reload: gettext("Load again"),
    clear: gettext("Clear stop…"),
    take: gettext("Take control"),
    ask: gettext("Ask for control"),
    back_off: gettext("Back off"),
    turn: gettext("Turn and look"),
    look: gettext("Look ahead"),
    forget: gettext("Forget…"),
    arm_home: gettext("Arm home"),
    dismiss: gettext("Understood"),
  }[act];
}

export class ReasonStrip {
  #parts;
  #acts;
  #notify;
  #announcer;
  #shown = null;
  #act = null; // of the button
  #actSinceMs = 0;
  #alarm = "";
  #listening = new AbortController();

  /**
   * @param {Record<string, HTMLElement>} parts
   * @param {Record<string, () => void>} acts what the button does, by the name in a reason
   * @param {(notice: object) => void} notify
   */
  constructor(parts, acts, notify) {
    this.#parts = parts;
    this.#acts = acts;
    this.#notify = notify;
    this.#announcer = new Announcer(parts.live);
    const { signal } = this.#listening;
    parts["reason-act"].addEventListener("click", () => this.#press(), { signal });
    parts["reason-act"].addEventListener("keydown", heldOnce, { signal });
  }

  /** @param {import("./faults.js").Reason[]} reasons the most important first */
  show(reasons) {
    const [first = null] = reasons;
    this.#sayAlarm(first);
    const { reason: strip, "reason-title": title, "reason-text": text } = this.#parts;
    const { "reason-more": more } = this.#parts;
    show(strip, first !== null);
    if (!first) this.#announcer.forget(this.#shown?.title);
    this.#shown = first;
    this.#offer(first?.act ?? null);
    if (!first) return;
    mark(strip, "level", first.level);
    setText(title, first.title);
    setTextOrHide(text, first.text ?? "");
    this.#offerMore(more, reasons);
    if (first.level !== "alarm") this.#announcer.announce(spoken(first), subject(first));
  }

  close() {
    this.#listening.abort();
    this.#announcer.close();
  }

  /** @param {?string} act what the button does from now on; null: there is none */
  #offer(act) {
    if (act === this.#act) return;
    this.#act = act;
    this.#actSinceMs = performance.now();
    const button = this.#parts["reason-act"];
    show(button, act !== null);
    mark(button, "act", act);
    if (act) setText(button, labelOf(act));
  }

  /** Do what the button says. A press that may have been meant for its last words moves no robot. */
  #press() {
    const isNew = performance.now() - this.#actSinceMs < TWO_TAPS_MS;
    if (!(isNew && MOVING.has(this.#act))) this.#acts[this.#act]();
  }

  /** Offer all reasons; of a reason alone, its text and detail: small windows have no place for them. */
  #offerMore(more, [first, ...others]) {
    const isAlone = others.length === 0;
    show(more, !isAlone || Boolean(first.text || first.detail));
    mark(more, "alone", isAlone);
    const [word, label] = isAlone
      ? ["…", gettext("Details")]
      : [gettext("See all %s"), gettext("See all %s reasons")];
    const count = 1 + others.length;
    setText(more, interpolate(word, [count]));
    more.setAttribute("aria-label", interpolate(label, [count]));
  }

  /** A screen reader reads an alarm at once, and again if its title changes. */
  #sayAlarm(first) {
    const alarm = first?.level === "alarm" ? first.title : "";
    if (alarm && alarm !== this.#alarm) {
      this.#notify({
        level: "error",
        code: first.code,
        text: [spoken(first), first.detail].filter(Boolean).join(" "),
        quiet: true,
      });
    }
    this.#alarm = alarm;
  }
}

function spoken({ title, text = "" }) {
  return text ? `${title}. ${text}` : title;
}

/** The same reason with other figures is not announced again. */
function subject({ title }) {
  return title.replace(/[\d.,]+/g, "");
}
