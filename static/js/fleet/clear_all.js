/** "Clear all" on the fleet page: lists the stopped robots with author and reason, and clears each. */

import { standstillText } from "../control/status/status_text.js";
import { closable } from "../lib/dialog.js";
import { make, makeButton, setText, show } from "../lib/dom.js";

/**
 * Return the stopped robots, each with whether this person may clear it. Pure.
 * @param {object} robots by slug, from the console
 */
export function stoppedOf(robots) {
  return Object.entries(robots)
    .filter(([, { state }]) => state && state.stop.state !== "clear")
    .map(([slug, { state, may_clear: mayClear }]) => ({ slug, stop: state.stop, mayClear }));
}

/** Return a text about a stop: author, reason and the robot's standstill. Pure. */
export function whyText(stop) {
  const by = stop.by
    ? interpolate(gettext("Stopped by %s."), [stop.by])
    : gettext("The person who stopped it is not known.");
  return [by, stop.reason, standstillText(stop)].filter(Boolean).join(" ");
}

export class ClearAll {
  #parts;
  #send;
  #name;
  #robots = {};
  #rows = new Map(); // by slug: the stop as the dialog showed it when it was opened, and the row's elements
  #listening = new AbortController();

  /**
   * @param {object} parts "clear-all", "clear-dialog", "clear-list", "clear-yes", "clear-none"
   * @param {(message: object) => boolean} send
   * @param {(slug: string) => string} name of a robot
   */
  constructor(parts, send, name) {
    this.#parts = parts;
    this.#send = send;
    this.#name = name;
    const { signal } = this.#listening;
    parts["clear-all"].addEventListener("click", () => this.#ask(), { signal });
    parts["clear-yes"].addEventListener("click", () => this.#clearAll(), { signal });
    closable(parts["clear-dialog"], signal);
  }

  /** The current states of the robots. */
  set robots(robots) {
    this.#robots = robots;
    const stopped = stoppedOf(robots);
    const mine = stopped.filter(({ mayClear }) => mayClear).length;
    const words = mine
      ? interpolate(gettext("Clear all (%s)…"), [mine])
      : interpolate(gettext("Stopped (%s)…"), [stopped.length]);
    setText(this.#parts["clear-all"], words);
    show(this.#parts["clear-all"], stopped.length > 0);
    for (const [slug, row] of this.#rows) this.#follow(slug, row);
  }

  /** The console refused to clear a robot. */
  refused({ text, figures }) {
    const row = this.#rows.get(figures?.slug);
    if (!row) return;
    row.asked = false;
    setText(row.words, text);
    show(row.button, row.mayClear);
  }

  close() {
    this.#listening.abort();
  }

  #ask() {
    const stopped = stoppedOf(this.#robots);
    this.#rows.clear();
    this.#parts["clear-list"].replaceChildren(...stopped.map((robot) => this.#row(robot)));
    const any = stopped.some(({ mayClear }) => mayClear);
    show(this.#parts["clear-yes"], any);
    show(this.#parts["clear-none"], !any);
    this.#parts["clear-dialog"].show();
  }

  #row({ slug, stop, mayClear }) {
    const name = this.#name(slug);
    const words = make("p", { className: "clear-words" });
    words.setAttribute("role", "status");
    const button = makeButton({ className: "button", text: gettext("Clear") }, () =>
      this.#clear(slug),
    );
    button.setAttribute("aria-label", interpolate(gettext("Clear the stop of %s"), [name]));
    const row = { number: stop.number, mayClear, asked: false, words, button };
    this.#rows.set(slug, row);
    show(button, mayClear);
    if (!mayClear)
      setText(
        words,
        gettext("Only the person in control, a supervisor of this robot, or staff may clear it."),
      );
    const texts = [make("strong", { text: name }), make("p", { text: whyText(stop) }), words];
    return make("li", { children: [make("div", { children: texts }), button] });
  }

  #clearAll() {
    for (const slug of this.#rows.keys()) this.#clear(slug);
    // The pressed button is hidden: the focus must stay in the dialog.
    show(this.#parts["clear-yes"], false);
    this.#parts["clear-dialog"].querySelector("[data-close]").focus();
  }

  /**
   * Clear a stop by the number that was shown: a newer stop, which the person has not seen, is not cleared.
   */
  #clear(slug) {
    const row = this.#rows.get(slug);
    if (!row.mayClear || row.asked || row.over) return;
    row.asked = true;
    show(row.button, false);
    const sent = this.#send({ t: "clear", slug, number: row.number });
    setText(row.words, sent ? gettext("Being cleared…") : gettext("Not sent: no connection."));
    if (!sent) row.asked = false;
  }

  #follow(slug, row) {
    const stop = this.#robots[slug]?.state?.stop;
    if (!stop || row.over) return;
    if (stop.state === "clear") {
      row.over = true;
      setText(row.words, gettext("Cleared."));
      show(row.button, false);
    } else if (stop.number !== row.number) {
      row.over = true;
      const again = gettext("%s stopped it again: close this and look again.");
      setText(row.words, interpolate(again, [stop.by ?? gettext("somebody")]));
      show(row.button, false);
    }
  }
}
