/** Short messages that leave by themselves; the same one twice is one. */

import { make } from "./dom.js";

const SHOWN_MS = { info: 6000, warning: 9000, error: 12000 };

export class Notices {
  #list;
  #shown = new Map();

  /** @param {HTMLElement} list a polite live region */
  constructor(list) {
    this.#list = list;
  }

  add({ level, code, text }) {
    this.#shown.get(code)?.end();
    const close = make("button", { className: "close", text: "×" });
    close.type = "button";
    close.setAttribute("aria-label", "Dismiss");
    const item = make("div", {
      className: "notice",
      data: { level },
      children: [make("p", { text }), close],
    });
    const end = () => {
      clearTimeout(timer);
      item.remove();
      this.#shown.delete(code);
    };
    const timer = setTimeout(end, SHOWN_MS[level] ?? SHOWN_MS.info);
    close.addEventListener("click", end);
    this.#shown.set(code, { end });
    this.#list.append(item);
  }

  close() {
    for (const { end } of this.#shown.values()) end();
  }
}
