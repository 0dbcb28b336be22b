/** The note on cookies: shown until a person on this device has closed it. */

import { recall, remember } from "../lib/prefs.js";

const READ = "cookies-read";

/** @param {HTMLElement} note has one button, which closes the note */
export function showOnce(note) {
  if (recall(READ, false)) return;
  note.hidden = false;
  note.querySelector("button").addEventListener("click", () => {
    remember(READ, true);
    note.hidden = true;
  });
}

for (const note of document.querySelectorAll("[data-cookie-note]")) showOnce(note);
