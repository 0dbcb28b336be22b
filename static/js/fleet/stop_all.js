/** "Stop all" on pages that have no live connection: it uses the form's own address. */

import { StopButton } from "../control/stop/stop_button.js";
import { StopWords } from "../control/stop/stop_words.js";

for (const form of document.querySelectorAll("form[data-stop-all]")) {
  const words = new StopWords(form.querySelector("[data-part=stop-all-state]"));
  new StopButton(form, {
    send: () => false,
    answered: () => true,
    showText: (text) => words.showText(text),
    fail: (text) => words.fail(text),
  });
}
