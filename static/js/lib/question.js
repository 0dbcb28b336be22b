/** A question in a dialog: what a person confirms is done, everything else is not. */

import { closable } from "./dialog.js";

/**
 * The dialog's form is submitted by a yes; everything else that closes it is a no.
 * @param {HTMLDialogElement} dialog
 * @param {(answer: FormData) => void} yes
 * @returns {{ask: () => void, close: () => void}}
 */
export function question(dialog, yes) {
  const listening = new AbortController();
  const { signal } = listening;
  const form = dialog.querySelector("form");
  form.addEventListener("submit", () => yes(new FormData(form)), { signal });
  closable(dialog, signal);
  return {
    ask() {
      form.reset();
      dialog.show();
    },
    close() {
      listening.abort();
      dialog.close();
    },
  };
}
