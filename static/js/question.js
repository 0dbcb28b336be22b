/** A question in a dialog: what a person confirms is done, everything else is not. */

/**
 * The dialog's form is submitted by a yes; a button with `data-close`, Escape and a lost dialog are a no.
 * @param {HTMLDialogElement} dialog
 * @param {(answer: FormData) => void} yes
 * @returns {{ask: () => void, close: () => void}}
 */
export function question(dialog, yes) {
  const listening = new AbortController();
  const { signal } = listening;
  const form = dialog.querySelector("form");
  form.addEventListener("submit", () => yes(new FormData(form)), { signal });
  dialog.querySelector("[data-close]").addEventListener("click", () => dialog.close(), { signal });
  return {
    ask() {
      form.reset();
      dialog.showModal();
    },
    close() {
      listening.abort();
      if (dialog.open) dialog.close();
    },
  };
}
