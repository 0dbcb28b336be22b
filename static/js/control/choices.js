/**
 * A person's choices about the control page. The console keeps them with the account; the browser has a copy.
 */

import { recall, remember } from "../lib/prefs.js";

export class Choices {
  #person;
  #address;
  #kept;

  /**
   * @param {DOMStringMap} data of the page: person, choices (JSON, as the console keeps them), choicesKeep
   *   (address)
   */
  constructor({ person, choices = "{}", choicesKeep }) {
    this.#person = person;
    this.#address = choicesKeep;
    this.#kept = JSON.parse(choices);
  }

  /** Return the account's choice; else this browser's copy: perhaps the console never received it. */
  recall(name, fallback) {
    return this.#kept[name] ?? recall(this.#copy(name), fallback);
  }

  /**
   * Keep a choice. Without a connection only this browser has it.
   * @param {string} name
   * @param {object | boolean} value an object's entries are the fields of the request
   */
  remember(name, value) {
    this.#kept[name] = value;
    remember(this.#copy(name), value);
    const token = document.querySelector('input[name="csrfmiddlewaretoken"]')?.value ?? "";
    const fields = typeof value === "object" ? value : { [name]: String(value) };
    fetch(this.#address, {
      method: "POST",
      headers: { Accept: "application/json", "X-CSRFToken": token },
      body: new URLSearchParams(fields),
      keepalive: true, // the person may leave the page at once
    }).catch(() => null);
  }

  #copy(name) {
    return `${name} ${this.#person}`;
  }
}
