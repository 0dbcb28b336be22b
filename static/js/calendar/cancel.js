/** Lists of bookings: asks before a booking is given up. */

import { parts, setText } from "../lib/dom.js";
import { question } from "../lib/question.js";

/**
 * Use one dialog for all forms with `data-asks`: it shows what is given up, and its yes button has the form's
 * own word.
 * @param {HTMLElement} root has the forms and the dialog
 */
export function askFirst(root) {
  const part = parts(root);
  let asking = null;
  const { ask } = question(part["cancel-dialog"], () => asking.submit());
  root.addEventListener("submit", (event) => {
    const form = event.target.closest("form[data-asks]");
    if (!form) return;
    event.preventDefault();
    asking = form;
    setText(part["cancel-title"], form.dataset.asks);
    setText(part["cancel-words"], form.dataset.words);
    setText(part["cancel-yes"], form.dataset.yes);
    ask();
  });
}

const page = document.querySelector("main:has([data-part='cancel-dialog'])");
if (page) askFirst(page);
