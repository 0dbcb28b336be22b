/** The robot's recorded motions, searchable: a press plays a motion, a second press cancels it. */

import { whyNotNow } from "../control/lease.js";
import { number } from "../formats/numbers.js";
import { dim, make, makeButton, mark, setText, setTextOrHide, show } from "../lib/dom.js";
import { SearchList } from "../lib/list.js";
import { heldOnce } from "../lib/presses.js";
import { leftOf } from "./lesson_tasks.js";
import { worded } from "./motion_words.js";
import { Endings, levelOf } from "./task_ends.js";

// A press this soon after the end of a motion was meant to cancel it: people need longer to react to the end.
const MEANT_CANCEL_MS = 500;

/** Notice of a motion's end. */
export function endNotice({ outcome, text }, title) {
  const outcomes = {
    succeeded: gettext("%s: done."),
    cancelled: gettext("%s: cancelled."),
    rejected: gettext("%s: the robot did not accept it."),
    failed: gettext("%s: failed."),
    stopped: gettext("%s: ended by the stop."),
    intruder: gettext("%s: cancelled, because something came near."),
    not_watched: gettext("%s: cancelled, because no sensor watched the space."),
    control_ended: gettext("%s: cancelled, because control ended."),
    link_lost: gettext("%s: cancelled, because the page was out of reach."),
    not_recorded: gettext("%s: cancelled."),
    unheard: gettext("%s: the robot did not report its end."),
  };
  const words = interpolate(outcomes[outcome] ?? `%s: ${outcome}`, [title]);
  return {
    level: levelOf(outcome),
    code: `motion ${outcome} ${title}`,
    text: text && outcome !== "succeeded" ? `${words} ${text}` : words,
  };
}

/** "3.2 s"; empty if the duration is not known. */
export function durationText(seconds) {
  if (!seconds) return "";
  return interpolate(gettext("%s s"), [seconds < 10 ? number(seconds, 1) : Math.round(seconds)]);
}

export class Motions {
  static hears = ["offers", "tasks", "state.motion", "mayAct", "mayCancel", "tab"];
  static task = "motion";
  static requests = {
    play: { name: ({ title, motion }) => interpolate(gettext("Play %s"), [title ?? motion]) },
    play_cancel: { name: () => gettext("Cancel the motion"), control: "optional" },
    refresh: {
      name: () => gettext("Read the list again"),
      done: () => gettext("The robot is asked for its list again."),
      control: "none",
    },
  };
  #parts;
  #send;
  #list;
  #buttons = new Map();
  #offers = null;
  #tasks = null;
  #titles = new Map(); // by name; kept while the robot is away and offers no motions
  #running = null;
  #ends;
  #ended = null; // the motion that ended last
  #endedMs = 0;
  #mayAct = null;
  #idle = ""; // why the robot plays no motion now
  #mayCancel = false;
  #listening = new AbortController();

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ parts, request: send, notify }) {
    this.#parts = parts;
    this.#send = send;
    this.#ends = new Endings((ended, name) => notify(endNotice(ended, this.titleOf(name))));
    this.#list = new SearchList(parts["motion-list"], {
      label: gettext("Search motions"),
      text: ({ name, title, usage, description }) => [title, name, usage, description].join(" "),
      group: ({ usage = "" }) => usage,
      row: (motion) => this.#row(motion),
    });
    const { signal } = this.#listening;
    parts["motions-refresh"].addEventListener("click", () => send({ t: "refresh" }), { signal });
    // Repeats of a held key would play and cancel the motion again and again.
    parts["motion-list"].addEventListener("keydown", heldOnce, { capture: true, signal });
  }

  /** @param {object} offers of the robot */
  set offers(offers) {
    this.#offers = offers;
    const { motions: offered = [], motions_text: text = "", uses = {} } = offers;
    const motions = leftOf(this.#tasks, "motions", worded(offered), ({ name }) => name);
    this.#idle = uses.motions?.refusal?.text ?? "";
    for (const { name, title } of motions) this.#titles.set(name, title || name);
    this.#buttons.clear();
    this.#list.items = motions;
    const why = text || gettext("This robot offers no motions.");
    setText(this.#parts["motions-none"], why);
    show(this.#parts["motions-none"], motions.length === 0);
    this.#show();
  }

  /** @param {?object} tasks that the present lesson leaves; null: all */
  set tasks(tasks) {
    this.#tasks = tasks;
    if (this.#offers) this.offers = this.#offers;
  }

  /** @param {{now: ?object, ended: ?object}} motion of the robot */
  set motion({ now, ended }) {
    const name = now?.name ?? null;
    this.#ends.follow(name, ended);
    if (name === this.#running) return;
    this.#ended = this.#running;
    this.#endedMs = performance.now();
    this.#running = name;
    this.#show();
  }

  /** @param {?boolean} may whether this tab has control; null: not known yet */
  set mayAct(may) {
    this.#mayAct = may;
    this.#show();
  }

  /** @param {boolean} may whether this person may cancel the running motion */
  set mayCancel(may) {
    this.#mayCancel = may;
    this.#show();
  }

  /** A motion's name for people. */
  titleOf(name) {
    return this.#titles.get(name) ?? name;
  }

  /** Another tab is shown: clear the search, whose field is not visible on every tab. */
  set tab(_) {
    this.#list.clear();
  }

  shows({ now }) {
    return now && { words: this.titleOf(now.name), who: now.who, cancel: [{ t: "play_cancel" }] };
  }

  sent({ t }) {
    return t === "refresh" ? null : this.#ends.begin(undefined, t === "play_cancel");
  }

  silent() {
    this.#ends.lost();
  }

  close() {
    this.#listening.abort();
    this.#list.close();
  }

  #row(motion) {
    const { name, title, description = "", duration_s: seconds } = motion;
    const act = make("span", { className: "act" });
    const words = make("span", {
      className: "hit-words",
      children: [
        make("span", { className: "hit-name", text: title || name }),
        make("span", { className: "hit-note", text: description }),
      ],
    });
    const figure = make("span", { className: "hit-figure", text: durationText(seconds) });
    const children = [act, words, figure]; // screen readers read `act` first; the style sheet puts it last
    // The second press of a double click does not cancel the motion that the first began.
    const button = makeButton(
      { className: "hit", children },
      ({ detail }) => detail < 2 && this.#press(motion),
    );
    this.#buttons.set(name, { button, act });
    return button;
  }

  #press({ name, title }) {
    const wasRunning = this.#ended === name && performance.now() - this.#endedMs < MEANT_CANCEL_MS;
    if (this.#running === name || wasRunning) this.#send({ t: "play_cancel" });
    else this.#send({ t: "play", motion: name, title: title || name });
  }

  /**
   * Update the buttons. Other motions stay enabled while one runs: the refusal reports who runs which motion.
   */
  #show() {
    const [play, cancel] = [gettext("Play"), gettext("Cancel")];
    const takeControl = this.#mayAct === false ? whyNotNow() : "";
    setTextOrHide(this.#parts["motions-hint"], this.#idle || takeControl);
    for (const [name, { button, act }] of this.#buttons) {
      const runs = name === this.#running;
      mark(button, "runs", runs);
      const [now, later] = runs ? [cancel, play] : [play, cancel];
      setText(act, now);
      act.dataset.later = later; // the button is as wide as the longer word, so that nothing moves
      const mayNot = runs ? !this.#mayCancel : !this.#mayAct || this.#idle !== "";
      dim(button, mayNot, (!runs && this.#idle) || whyNotNow());
    }
  }
}
