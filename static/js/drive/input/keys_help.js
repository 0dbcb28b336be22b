/** The list of keys and gamepad buttons: shown on "?", and from the menu. */

import { closable } from "../../lib/dialog.js";
import { isEditing } from "../../lib/editing.js";

/**
 * @param {HTMLDialogElement} dialog
 * @param {HTMLElement} opener
 * @returns {() => void} ends it
 */
export function keysHelp(dialog, opener) {
  const listening = new AbortController();
  const { signal } = listening;
  const toggle = () => (dialog.open ? dialog.close() : dialog.show());
  opener.addEventListener("click", () => dialog.open || dialog.show(), { signal });
  closable(dialog, signal);
  window.addEventListener(
    "keydown",
    (event) => {
      if (event.key !== "?" || event.ctrlKey || event.altKey || event.metaKey) return;
      if (isEditing(event.target) && !dialog.contains(event.target)) return;
      event.preventDefault();
      toggle();
    },
    { signal },
  );
  return () => {
    listening.abort();
    dialog.close();
  };
}
