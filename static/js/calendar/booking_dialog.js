/** Asks before a dragged slot is booked, with the form's fields; shows refusals, and free slots instead. */

import { closable } from "../lib/dialog.js";
import { make, makeButton, setText, show } from "../lib/dom.js";
import { send } from "./bookings_api.js";

export class BookingDialog {
  #part;
  #urls;
  #done;
  #wish = null;

  /**
   * @param {Record<string, HTMLElement>} part of the page
   * @param {{new: string, waiting: string}} urls for booking a slot, and for waiting for a slot
   * @param {() => void} done is called when a slot was booked
   */
  constructor(part, urls, done) {
    this.#part = part;
    this.#urls = urls;
    this.#done = done;
    closable(part.dialog, new AbortController().signal);
    part["dialog-form"].addEventListener("submit", (event) => {
      event.preventDefault();
      this.#book();
    });
    part["dialog-wait"].addEventListener("click", () => this.#wait());
  }

  /** Asks about a slot that was dragged; without a robot, the page with the form opens. */
  ask(start, end, resource) {
    const robot = resource?.id;
    if (!robot) {
      location.assign(`${this.#urls.new}?from=${start.slice(0, 16)}&to=${end.slice(0, 16)}`);
      return;
    }
    this.#wish = slotOf(robot, start.slice(0, 16), end.slice(0, 16));
    this.#open(gettext("Book this slot?"), slotWords(resource.title, start, end));
  }

  /**
   * Shows why a booking was not changed.
   * @param {string[]} texts
   * @param {(free: object) => void} [choose] takes a free slot
   */
  tell(texts, alternatives = [], choose = undefined) {
    this.#wish = null;
    this.#open(gettext("Not changed"), "");
    this.#list(texts, alternatives, choose);
  }

  /** Closes the dialog, if it is open. */
  close() {
    this.#part.dialog.close();
  }

  #open(title, words) {
    const { dialog, "dialog-title": heading, "dialog-words": slot } = this.#part;
    this.#part["dialog-form"].reset();
    setText(heading, title);
    setText(slot, words);
    this.#list([], []);
    this.#offer({ book: this.#wish !== null, wait: false });
    if (!dialog.open) dialog.show();
    heading.focus();
  }

  #offer({ book, wait }) {
    show(this.#part["dialog-fields"], book);
    show(this.#part["dialog-yes"], book);
    show(this.#part["dialog-wait"], wait);
  }

  #list(texts, alternatives, choose = (free) => this.#bookThat(free)) {
    this.#part.refusals.replaceChildren(...texts.map((text) => make("li", { text })));
    this.#part.alternatives.replaceChildren(
      ...alternatives.map((free) =>
        make("li", {
          children: [makeButton({ className: "button", text: free.words }, () => choose(free))],
        }),
      ),
    );
  }

  #bookThat({ robot, start, end, words }) {
    this.#wish = slotOf(robot, start, end);
    setText(this.#part["dialog-words"], words);
    this.#book();
  }

  #fields() {
    return { ...this.#wish, ...Object.fromEntries(new FormData(this.#part["dialog-form"])) };
  }

  async #book() {
    const answer = await send(this.#urls.new, this.#fields());
    if (answer.ok) {
      this.#part.dialog.close();
      this.#done();
      return;
    }
    setText(this.#part["dialog-title"], gettext("Not booked"));
    // Another course, person or reason may be allowed.
    this.#offer({ book: true, wait: answer.codes.join() === "taken" });
    this.#list(answer.texts, answer.alternatives);
  }

  async #wait() {
    const answer = await send(this.#urls.waiting, this.#fields());
    this.#offer({ book: !answer.ok, wait: false });
    this.#list(answer.texts, answer.alternatives);
    if (!answer.ok) return;
    setText(this.#part["dialog-title"], gettext("You wait for this slot"));
    setText(this.#part["dialog-words"], gettext("You get an offer when it becomes free."));
  }
}

/** Begin and end as the console's forms read them; a time that comes twice has its offset. */
function slotOf(robot, start, end) {
  return { robot, starts_at: start, ends_at: end };
}

function slotWords(robot, start, end) {
  const clock = (text) => text.slice(11, 16);
  return `${robot}, ${start.slice(0, 10)}, ${clock(start)} – ${clock(end)}`;
}
