/** "Stop all" on pages that have no live connection: it goes by the form's own address. */

import { StopButton } from "./stop.js";

for (const form of document.querySelectorAll("form[data-stop-all]")) {
  const state = form.querySelector("[data-part=stop-all-state]");
  const say = (text) => {
    state.textContent = text;
  };
  new StopButton(form, {
    send: () => false,
    answered: () => true,
    say,
    fail: say,
  });
}
