/** A question in a dialog: an action runs only if the person confirms it. */

import { closable } from "./dialog.js";

/**
 * To submit the dialog's form means yes; to close the dialog in another way means no.
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
