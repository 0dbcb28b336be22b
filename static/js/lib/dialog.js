/** Non-modal dialogs: a person can stop the robots while a dialog is open. */

import { barBeside, newestDialog } from "./beside.js";

/**
 * Escape and the buttons with `data-close` close it; Escape beside the dialogs closes the newest. While it is open,
 * nothing beside it acts, except stops.
 * @param {HTMLDialogElement} dialog is shown by `show()`, never by `showModal()`
 * @param {AbortSignal} signal ends the listening
 */
export function closable(dialog, signal) {
  const close = () => dialog.close();
  for (const button of dialog.querySelectorAll("[data-close]"))
    button.addEventListener("click", close, { signal });
  const leave = (event) => {
    if (event.key !== "Escape" || event.defaultPrevented) return;
    event.preventDefault();
    close();
  };
  const leaveBeside = (event) => newestDialog() === dialog && leave(event);
  dialog.addEventListener("keydown", leave, { signal });
  window.addEventListener("keydown", leaveBeside, { signal });
  barBeside(dialog, signal);
}
