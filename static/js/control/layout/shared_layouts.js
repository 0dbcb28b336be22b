/** Layouts that supervisors of the robot and staff share: everybody may choose one of them. */

import { readJson } from "../../connection/read.js";
import { send } from "../../connection/write.js";
import { make, makeButton, setTextOrHide, show } from "../../lib/dom.js";
import { isAtLeast } from "../roles.js";

/** Event: "choose" (detail: a layout). */
export class SharedLayouts extends EventTarget {
  #parts;
  #address;
  #shares; // returns the present layout
  #isSupervisor = false;
  #layouts = [];
  #listening = new AbortController();

  /**
   * @param {Record<string, HTMLElement>} parts
   * @param {string} address of the robot's layouts
   * @param {() => {cells: string[], side: boolean}} shares returns the layout that is shared under a new name
   */
  constructor(parts, address, shares) {
    super();
    this.#parts = parts;
    this.#address = address;
    this.#shares = shares;
    const share = (event) => {
      event.preventDefault();
      this.#share(parts["layout-name"].value.trim());
    };
    parts["layout-form"].addEventListener("submit", share, { signal: this.#listening.signal });
  }

  set role(role) {
    this.#isSupervisor = isAtLeast(role, "supervisor");
    show(this.#parts["layout-form"], this.#isSupervisor);
    this.#show();
  }

  /** Read them again. */
  async read() {
    await this.#tried(async () => {
      const failed = gettext("The shared layouts could not be read.");
      this.#layouts = (await readJson(this.#address, failed)).layouts;
    });
  }

  close() {
    this.#listening.abort();
  }

  async #share(name) {
    if (!name) return;
    await this.#tried(async () => {
      const layout = await send("POST", this.#address, { name, ...this.#shares() });
      this.#layouts = [...this.#layouts, layout];
      this.#parts["layout-name"].value = "";
      this.#parts["layout-name"].blur(); // so that keys drive again
    });
  }

  async #delete({ number }) {
    await this.#tried(async () => {
      await send("DELETE", `${this.#address}/${number}`);
      this.#layouts = this.#layouts.filter((one) => one.number !== number);
    });
  }

  /** Do it, and show the result or the reason why not. */
  async #tried(act) {
    let why = "";
    try {
      await act();
    } catch (error) {
      why = error.message;
    }
    if (this.#listening.signal.aborted) return;
    setTextOrHide(this.#parts["layouts-fault"], why);
    this.#show();
  }

  #show() {
    show(this.#parts.layouts, this.#layouts.length > 0 || this.#isSupervisor);
    this.#parts["layouts-list"].replaceChildren(
      ...this.#layouts.map((layout) => make("li", { children: this.#buttons(layout) })),
    );
  }

  #buttons(layout) {
    const choose = makeButton({ className: "button", text: layout.name }, () =>
      this.dispatchEvent(new CustomEvent("choose", { detail: layout })),
    );
    if (!this.#isSupervisor) return [choose];
    const remove = makeButton({ className: "button", text: "×" }, () => this.#delete(layout));
    remove.setAttribute("aria-label", interpolate(gettext("Delete “%s”"), [layout.name]));
    return [choose, remove];
  }
}
