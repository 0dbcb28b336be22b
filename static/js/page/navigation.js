/** The links of the header: those that do not fit into its row are in the menu instead. */

import { mark, show } from "../lib/dom.js";

/**
 * Keep each link in one of the two. In the row, which wraps, the style sheet hides the `folded` ones.
 * @param {HTMLElement} row
 * @param {HTMLElement} menu the same links in the same order
 */
export function foldInto(menu, row) {
  const fold = () => {
    const hidden = row.offsetParent === null; // the window is narrow or low
    const top = row.firstElementChild.offsetTop;
    for (const [index, link] of [...row.children].entries()) {
      const folded = hidden || link.offsetTop > top;
      mark(link, "folded", folded);
      show(menu.children[index], folded);
    }
  };
  const sizes = new ResizeObserver(fold);
  for (const one of [row, ...row.children]) sizes.observe(one);
}

const row = document.querySelector("[data-pages]");
if (row) foldInto(document.querySelector("[data-menu-pages]"), row);
