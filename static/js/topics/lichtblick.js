/** *Open in Lichtblick*: an address of this robot's topics that works once, to copy or to open in a new tab. */

import { copy } from "../accounts/copy.js";
import { send } from "../connection/write.js";
import { closable } from "../lib/dialog.js";
import { setText, setTextOrHide } from "../lib/dom.js";

const RENEW_MS = 30_000; // an address lives for a minute: what is shown leaves time to paste it

export class Lichtblick {
  static hears = [];
  #dialog;
  #field;
  #button;
  #copyText;
  #link; // without a Lichtblick on this server: none
  #fault;
  #data;
  #timer = null;
  #listening = new AbortController();

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ root, parts }) {
    const { signal } = this.#listening;
    this.#data = root.dataset;
    this.#dialog = parts["lichtblick-dialog"];
    this.#field = parts["lichtblick-address"];
    this.#link = parts["lichtblick-link"] ?? null;
    this.#fault = parts["lichtblick-fault"];
    this.#button = parts["lichtblick-copy"];
    this.#copyText = this.#button.textContent;
    this.#button.addEventListener("click", () => copy(this.#button, this.#field), { signal });
    for (const opener of [parts["lichtblick-open"], parts["topics-lichtblick"]])
      opener.addEventListener("click", () => this.#open(), { signal });
    // A new tab uses the address up
    this.#link?.addEventListener("click", () => setTimeout(() => this.#renewLink()), { signal });
    this.#dialog.addEventListener("close", () => this.#end(), { signal });
    closable(this.#dialog, signal);
  }

  close() {
    this.#listening.abort();
    this.#end();
    this.#dialog.close();
  }

  #open() {
    if (this.#dialog.open) return;
    this.#dialog.show();
    this.#renew();
    this.#timer = setInterval(() => this.#renew(), RENEW_MS);
  }

  #end() {
    clearInterval(this.#timer);
    this.#timer = null;
  }

  /** Two addresses, so that the one that is copied does not use up the one of the link. */
  #renew() {
    if (document.activeElement !== this.#field || !this.#field.value) this.#renewField();
    this.#renewLink();
  }

  #renewField() {
    return this.#try(async () => {
      this.#field.value = await this.#address();
      setText(this.#button, this.#copyText);
    });
  }

  #renewLink() {
    return this.#try(async () => {
      if (!this.#link) return;
      const query = new URLSearchParams({
        ds: "foxglove-websocket",
        "ds.url": await this.#address(),
      });
      this.#link.href = `${this.#data.lichtblick}?${query}`;
    });
  }

  async #try(work) {
    try {
      await work();
      setTextOrHide(this.#fault, "");
    } catch (error) {
      setTextOrHide(this.#fault, error.message);
    }
  }

  async #address() {
    const { path } = await send("POST", this.#data.tickets, { door: "foxglove" });
    const { protocol, host } = window.location;
    return `${protocol === "https:" ? "wss:" : "ws:"}//${host}${path}`;
  }
}
