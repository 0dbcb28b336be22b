/** The page of a lesson: its lines as they change, one press for each step, and the time that is left. */

import { readJson } from "../connection/read.js";
import { clockText } from "../control/lease.js";
import { StopButton } from "../control/stop/stop_button.js";
import { make, parts, setText, setTextOrHide, show } from "../lib/dom.js";
import { TWO_TAPS_MS } from "../lib/presses.js";
import { worded } from "../tasks/motion_words.js";
import { atMost, listen } from "./live.js";

const READS_MS = 500; // between two reads of the page
const FRESH_MS = 30_000; // estimates of "about 14 min" change with time alone
const TICK_MS = 500;

export class LessonPage {
  #parts;
  #url;
  #order = ""; // of the buttons
  #shownMs = performance.now(); // when they came
  #movedMs = Number.NEGATIVE_INFINITY; // when buttons moved under fingers, not by a press here
  #pressed = false;
  #stops = new Map(); // by address: a stop's button stays the same element, so that no press is lost
  #changes;
  #timers;

  /** @param {HTMLElement} root @param {string} url of the page */
  constructor(root, url = location.href) {
    this.#parts = parts(root);
    this.#url = url;
    const { live } = this.#parts;
    this.#order = orderOf(live);
    this.#keepStops(live);
    live.addEventListener("submit", (event) => this.#submit(event));
    live.addEventListener("pointerdown", () => {
      this.#pressed = true;
    });
    for (const end of ["pointerup", "pointercancel"])
      document.addEventListener(end, () => {
        this.#pressed = false;
      });
    const read = atMost(() => this.#read(), READS_MS);
    this.#changes = listen(root.dataset.socket, read, { turns: true });
    this.#timers = [setInterval(read, FRESH_MS), setInterval(() => this.#tick(), TICK_MS)];
    this.#tick();
    const { motions } = this.#parts;
    const tasks = motions?.closest("details");
    if (tasks?.open) this.#offerMotions(motions);
    else tasks?.addEventListener("toggle", () => this.#offerMotions(motions), { once: true });
  }

  close() {
    for (const timer of this.#timers) clearInterval(timer);
    for (const { button } of this.#stops.values()) button.close();
    this.#changes.close();
  }

  async #read() {
    const answer = await fetch(this.#url, { headers: { "X-Live": "1" } }).catch(() => null);
    await this.#show(answer, false);
  }

  /** Send the press of a button; the answer is the page as it is then. */
  async #submit(event) {
    const form = event.target;
    if ("stop" in form.dataset) return;
    event.preventDefault();
    if (performance.now() - this.#movedMs < TWO_TAPS_MS) return; // the finger was on another button
    const body = new FormData(form, event.submitter);
    event.submitter?.setAttribute("aria-disabled", "true");
    const answer = await fetch(form.getAttribute("action"), { method: "POST", body }).catch(
      () => null,
    );
    const isWhole = answer?.ok && answer.url !== this.#url; // of another robot of the lesson
    await (isWhole ? this.#read() : this.#show(answer, true));
  }

  async #show(answer, mine) {
    const text = answer?.headers.get("Content-Type")?.includes("html") ? await answer.text() : "";
    const fresh = new DOMParser().parseFromString(text, "text/html");
    const lines = fresh.querySelector("[data-part=live]");
    const failed = gettext("The server does not answer: what you see may be old.");
    setTextOrHide(this.#parts.news, lines ? "" : failed);
    if (!lines || (this.#pressed && !mine)) return; // a finger is down: the next hint shows it
    this.#shownMs = performance.now();
    const order = orderOf(lines);
    if (order !== this.#order && !mine) this.#movedMs = this.#shownMs;
    this.#order = order;
    this.#keepStops(lines);
    const focused = keyOf(document.activeElement);
    this.#parts.live.replaceChildren(...lines.childNodes);
    if (focused) this.#parts.live.querySelector(focused)?.focus();
    this.#tick();
  }

  #keepStops(lines) {
    for (const form of lines.querySelectorAll("form[data-stop]")) {
      const address = form.getAttribute("action");
      const held = this.#stops.get(address);
      if (held) form.replaceWith(held.form);
      else this.#stops.set(address, { form, button: this.#stopButton(form) });
    }
  }

  #stopButton(form) {
    const say = (text) => setTextOrHide(this.#parts.news, text);
    return new StopButton(form, {
      send: () => false,
      answered: () => true,
      showText: say,
      fail: say,
    });
  }

  #tick() {
    const sinceS = (performance.now() - this.#shownMs) / 1000;
    for (const left of this.#parts.live.querySelectorAll("[data-left]"))
      setText(left, clockText(Math.max(Number(left.dataset.left) - sinceS, 0)));
  }

  /** Add the motions that the robot offers now to those that are chosen. */
  async #offerMotions(field) {
    const answer = await readJson(field.dataset.motions, "").catch(() => null);
    const chosen = new Set([...field.querySelectorAll("[name=motions]")].map(({ value }) => value));
    const offered = worded(answer?.motions ?? []).filter(({ name }) => !chosen.has(name));
    this.#parts["motion-ticks"].append(
      ...offered.map(({ name, title }) => {
        const box = make("input");
        Object.assign(box, { type: "checkbox", name: "motions", value: name });
        const text = make("span", { text: title || name });
        return make("label", { className: "tick", children: [box, text] });
      }),
    );
    if (answer?.motions?.length) show(this.#parts["motions-none"], false);
  }
}

/** Return what each button does, and for whom, in their order. */
function orderOf(lines) {
  return [...lines.querySelectorAll("button")].map(keyOf).join();
}

/** Return a selector of the button that has the focus: the same button of the same robot and person. */
function keyOf(button) {
  const form = button?.closest?.("[data-part=live] form");
  const turn = form?.querySelector("[name=turn]")?.value;
  if (!form || !button.value) return "";
  const which = turn ? `:has([name=turn][value="${turn}"])` : "";
  return `form[action="${form.getAttribute("action")}"]${which} button[value="${button.value}"]`;
}

const root = document.querySelector("[data-page=lesson]");
if (root) new LessonPage(root);
