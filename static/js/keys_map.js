/** The map of keyboard and gamepad: shown on "?", and from the menu. */

import { isEditing } from "./keyboard.js";

/**
 * @param {HTMLDialogElement} dialog is not modal: the stop beside it must never wait
 * @param {HTMLElement} opener
 * @returns {() => void} ends it
 */
export function keysMap(dialog, opener) {
  const listening = new AbortController();
  const { signal } = listening;
  const toggle = () => (dialog.open ? dialog.close() : dialog.show());
  opener.addEventListener("click", () => dialog.open || dialog.show(), { signal });
  dialog.querySelector("[data-close]").addEventListener("click", () => dialog.close(), { signal });
  window.addEventListener(
    "keydown",
    (event) => {
      if (event.key === "Escape" && dialog.open) dialog.close();
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
