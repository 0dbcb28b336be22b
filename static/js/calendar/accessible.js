/** Corrects the calendar library's markup for screen readers. */

const STRUCTURE = ".ec[role], .ec [role]:not([aria-level])";

/**
 * Remove the library's table roles: required rows are missing, and screen readers read no table better than a
 * broken table. Correct the headings of days, which skip a level. Remove the focus of bookings: each has a
 * link with its words.
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
