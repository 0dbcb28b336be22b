/** The control panel: holder, buttons, requests of others, dialogs. Reports choices by "choose" events. */

import { make, makeButton, mark, setText, setTextOrHide, show } from "../lib/dom.js";
import { question } from "../lib/question.js";
import { clockText, isLastCall, remaining } from "./lease.js";
import {
  controlWords,
  isSlotFar,
  lessonWords,
  slotWarning,
  slotWords,
} from "./status/control_words.js";

const UNKNOWN = { state: "unknown", requests: [] };
// A press this soon after a request was meant for the button that was there before: people need longer to
// react.
const MEANT_BEFORE_MS = 500;

/**
 * Events: "choose" (detail: a message for the server), "warn" (detail: words about a slot that ends control
 * soon).
 */
export class ControlPanel extends EventTarget {
  #parts;
  #control = UNKNOWN;
  #receivedMs = 0;
  #silent = "";
  #warned = { atS: Infinity, ending: "" };
  #timer;
  #takeOver;
  #offeredMs = new Map(); // by request: time from which control can be handed over to this person
  #listening = new AbortController();

  /** @param {Record<string, HTMLElement>} parts */
  constructor(parts) {
    super();
    this.#parts = parts;
    const { signal } = this.#listening;
    for (const button of parts.actions.querySelectorAll("button[data-action]")) {
      // Ignore the second press of a double click: after "take" it would release control.
      const press = ({ detail: presses }) => presses < 2 && this.#act(button.dataset.action);
      button.addEventListener("click", press, { signal });
    }
    this.#takeOver = question(parts["take-over-dialog"], (answer) =>
      this.#choose({ t: "take_over", reason: answer.get("reason").trim() }),
    );
    this.#timer = setInterval(() => this.#count(), 250);
  }

  /** The server's newest `control`; null while there is no connection. */
  set control(control) {
    this.#control = control ?? UNKNOWN;
    this.#receivedMs = performance.now();
    this.#count();
    this.#showRequests(this.#control.requests);
  }

  /** @param {string} who the part of the way to the robot that does not answer (`silenceOf`); empty: none */
  set silent(who) {
    if (who === this.#silent) return;
    this.#silent = who;
    this.#count();
  }

  close() {
    clearInterval(this.#timer);
    this.#listening.abort();
    this.#takeOver.close();
  }

  #count() {
    const now = performance.now();
    const left = remaining(this.#control.remaining_s, this.#receivedMs, now);
    const resumable = remaining(this.#control.resumable_s, this.#receivedMs, now);
    const offered = remaining(this.#control.offer_s, this.#receivedMs, now);
    const { headline, reason, actions } = controlWords(
      this.#control,
      resumable,
      offered,
      this.#silent,
    );
    const yours = this.#control.state === "yours";
    const { who, why, lease } = this.#parts;
    setText(who, headline);
    setTextOrHide(why, reason);
    show(lease, left !== null);
    if (left !== null) setText(lease, interpolate(gettext("%s left"), [clockText(left)]));
    mark(lease, "last", yours && isLastCall(left));
    this.#showSlot((now - this.#receivedMs) / 1000);
    this.#offer(actions);
  }

  #showSlot(sinceS) {
    setTextOrHide(this.#parts.slot, slotWords(this.#control, sinceS));
    mark(this.#parts.slot, "far", isSlotFar(this.#control, sinceS));
    this.#showLesson(sinceS);
    const warning = slotWarning(this.#control, sinceS);
    const { atS = Infinity, ending = "", text = "" } = warning ?? {};
    if (atS < this.#warned.atS || (text && ending !== this.#warned.ending))
      this.dispatchEvent(new CustomEvent("warn", { detail: text }));
    this.#warned = { atS, ending };
  }

  #showLesson(sinceS) {
    const { lesson, "lesson-words": words, "lesson-link": link } = this.#parts;
    const { lesson: present } = this.#control;
    show(lesson, Boolean(present));
    setText(words, lessonWords(this.#control, sinceS));
    if (present) link.href = `/bookings/${present.booking}/lesson/`;
  }

  /** Show the buttons of these actions. If this hides the focused button, a visible one gets the focus. */
  #offer(actions) {
    const buttons = [...this.#parts.actions.children];
    const focused = buttons.find((button) => button === document.activeElement);
    for (const button of buttons) show(button, actions.includes(button.dataset.action));
    if (focused?.hidden) buttons.find(({ hidden }) => !hidden)?.focus();
  }

  /** Show the requests of others: the person's own request is already shown above. */
  #showRequests(requests) {
    const others = requests.filter(({ number }) => number !== this.#control.asking);
    const offered = this.#control.state === "yours" ? others : [];
    const now = performance.now();
    this.#offeredMs = new Map(
      offered.map(({ number }) => [number, this.#offeredMs.get(number) ?? now]),
    );
    const items = others.map(({ number, name }) => {
      const words = make("span", { text: interpolate(gettext("%s asks for control"), [name]) });
      const children = this.#offeredMs.has(number)
        ? [words, this.#handOver(number, name)]
        : [words];
      return make("li", { children });
    });
    this.#parts.requests.replaceChildren(...items);
    // A long line can be scrolled, also by keys.
    if (items.length > 1) this.#parts.requests.tabIndex = 0;
    else this.#parts.requests.removeAttribute("tabindex");
    show(this.#parts.requests, items.length > 0);
  }

  #handOver(number, name) {
    const text = interpolate(gettext("Hand over to %s"), [name]);
    const button = makeButton({ className: "button primary", text: gettext("Hand over") }, () =>
      this.#choose({ t: "hand_over", number }),
    );
    button.setAttribute("aria-label", text); // the visible name is beside the button
    const tooSoonMs = this.#offeredMs.get(number) + MEANT_BEFORE_MS - performance.now();
    if (tooSoonMs > 0) {
      button.disabled = true;
      setTimeout(() => {
        button.disabled = false;
      }, tooSoonMs);
    }
    return button;
  }

  #act(action) {
    if (action === "take_over") this.#takeOver.ask();
    else if (action === "take_back") this.#choose({ t: "take_over", reason: "" });
    else this.#choose({ t: action });
  }

  #choose(message) {
    this.dispatchEvent(new CustomEvent("choose", { detail: message }));
  }
}
