/** The pages in the palette: those to which this page links in its header and menu, and its own tabs. */

const LINKS = ".tabs [role=tab], .menu-list a, .details a";

/** @returns {import("./palette.js").Entry[]} */
export function pages() {
  const links = [...document.querySelectorAll(LINKS)];
  return links.map((link) => ({
    name: link.textContent.trim(),
    does:
      link.getAttribute("role") === "tab" ? gettext("Shows this tab") : gettext("Opens this page"),
    act: () => link.click(),
  }));
}
