/** Openers of the palette: a button of the menu, and Ctrl+K, on a Mac Cmd+K. */

import { setText, show } from "../lib/dom.js";

function isMac() {
  return /Mac|iPhone|iPad/.test(navigator.platform);
}

function isHotkey({ code, ctrlKey, metaKey, altKey, shiftKey }) {
  if (code !== "KeyK" || altKey || shiftKey) return false;
  return isMac() ? metaKey && !ctrlKey : ctrlKey && !metaKey;
}

/**
 * @param {HTMLElement} button in the menu, with the keys in a `kbd`; hidden where no script calls this
 * @param {() => void} toggle opens the palette, or closes it
 * @param {AbortSignal} [signal] ends it
 */
export function opensPalette(button, toggle, signal) {
  if (isMac()) setText(button.querySelector("kbd"), "⌘ K");
  const shutMenu = () => {
    const menu = button.closest("details");
    menu.querySelector("summary").focus(); // gets the focus back when the palette closes
    menu.open = false;
    toggle();
  };
  const press = (event) => {
    if (!isHotkey(event)) return;
    event.preventDefault();
    if (!event.repeat) toggle();
  };
  show(button, true);
  button.addEventListener("click", shutMenu, { signal });
  window.addEventListener("keydown", press, { signal });
}
