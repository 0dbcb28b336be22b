/** Corrects the calendar library's markup for screen readers. */

const STRUCTURE = ".ec[role], .ec [role]:not([aria-level])";

/**
 * The library builds a table of roles in which required rows are missing: none is read better than a broken one. Its
 * headings of days skip a level. Each booking is a link with its own words.
 * @param {HTMLElement} root
 */
export function correctRoles(root) {
  const correct = () => {
    for (const element of root.querySelectorAll(STRUCTURE)) element.removeAttribute("role");
    for (const element of root.querySelectorAll("[aria-colindex]"))
      element.removeAttribute("aria-colindex");
    for (const scrolled of root.querySelectorAll(".ec-main:not([tabindex])")) scrolled.tabIndex = 0;
    for (const heading of root.querySelectorAll("h4:not([aria-level])")) {
      heading.setAttribute("role", "heading");
      heading.setAttribute("aria-level", "3");
    }
    for (const event of root.querySelectorAll("article[tabindex]"))
      event.removeAttribute("tabindex");
  };
  new MutationObserver(correct).observe(root, { childList: true, subtree: true });
  correct();
}
