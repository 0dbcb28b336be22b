/** A question in a dialog: what a person confirms is done, everything else is not. */

/**
 * The dialog's form is submitted by a yes; a button with `data-close` and Escape are a no.
 * It is not modal: the stop beside it must never wait for an answer.
 * @param {HTMLDialogElement} dialog
 * @param {(answer: FormData) => void} yes
 * @returns {{ask: () => void, close: () => void}}
 */
export function question(dialog, yes) {
  const listening = new AbortController();
  const { signal } = listening;
  const form = dialog.querySelector("form");
  const no = () => dialog.close();
  form.addEventListener("submit", () => yes(new FormData(form)), { signal });
  dialog.querySelector("[data-close]").addEventListener("click", no, { signal });
  dialog.addEventListener("keydown", ({ key }) => key === "Escape" && no(), { signal });
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
