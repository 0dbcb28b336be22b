/** Non-modal dialogs: a person can stop the robots while a dialog is open. */

import { barBeside } from "./beside.js";

/**
 * Escape and the buttons with `data-close` close it. While it is open, nothing beside it acts, except stops.
 * @param {HTMLDialogElement} dialog is shown by `show()`, never by `showModal()`
 * @param {AbortSignal} signal ends the listening
 */
export function closable(dialog, signal) {
  const close = () => dialog.close();
  for (const button of dialog.querySelectorAll("[data-close]"))
    button.addEventListener("click", close, { signal });
  dialog.addEventListener("keydown", ({ key }) => key === "Escape" && close(), { signal });
  barBeside(dialog, signal);
}
