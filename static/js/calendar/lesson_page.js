/** Keeps the line of a lesson up to date on its page: what the server shows replaces what is shown. */

import { parts } from "../lib/dom.js";

const EVERY_MS = 3000;

/**
 * Replace the line if it changed. The focus stays on the button of the same name.
 * @param {HTMLElement} shown
 * @param {HTMLElement | null} newest
 * @returns {boolean} whether it changed
 */
export function replaced(shown, newest) {
  if (!newest || newest.textContent === shown.textContent) return false;
  const name = shown.contains(document.activeElement) ? document.activeElement.textContent : null;
  shown.replaceChildren(...newest.childNodes);
  if (name !== null)
    [...shown.querySelectorAll("button")].find((one) => one.textContent === name)?.focus();
  return true;
}

async function refresh(shown) {
  if (document.hidden) return;
  const answer = await fetch(location.pathname, { headers: { Accept: "text/html" } });
  if (!answer.ok || answer.redirected) return;
  const page = new DOMParser().parseFromString(await answer.text(), "text/html");
  replaced(shown, page.querySelector("[data-part=line]"));
}

const { line } = parts(document);
if (line) setInterval(() => refresh(line).catch(() => {}), EVERY_MS); // the next one tries again
