/**
 * Every page of the admin: rows in place of JSON, suggested names of people, names of the admin's own fields.
 */

import { showRows } from "./pairs.js";
import { suggestPeople } from "./people.js";
import "../lib/reached_fields.js";

for (const box of document.querySelectorAll("textarea[data-pairs]")) showRows(box);
for (const input of document.querySelectorAll("input[data-people]")) suggestPeople(input);

/** Give the admin's autocomplete fields a name for screen readers: the text of their label. */
function nameFields() {
  for (const select of document.querySelectorAll("select.admin-autocomplete")) {
    const name = select.getAttribute("aria-label") ?? select.labels?.[0]?.textContent.trim();
    const shown = select.nextElementSibling?.querySelector("[role=combobox]");
    if (!name || !shown || shown.hasAttribute("aria-label")) continue;
    const value = shown.querySelector(".select2-selection__rendered");
    shown.setAttribute("aria-label", name.replace(/:$/, ""));
    shown.removeAttribute("aria-labelledby");
    if (!value) continue;
    shown.setAttribute("aria-describedby", value.id);
    value.removeAttribute("role"); // with the role, it would be a second field without a name
    value.removeAttribute("aria-readonly");
  }
  for (const search of document.querySelectorAll(".select2-search__field:not([aria-label])")) {
    search.setAttribute("aria-label", gettext("Search"));
  }
}

nameFields();
new MutationObserver(nameFields).observe(document.body, { childList: true, subtree: true });
