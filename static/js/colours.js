/** The style sheet's colours, for what is painted and not styled. */

/** @param {HTMLElement} element @param {string[]} names of custom properties @returns {string[]} as a canvas takes them */
export function coloursOf(element, names) {
  const tried = document.createElement("span");
  element.append(tried);
  const found = names.map((name) => {
    tried.style.color = `var(${name})`;
    return getComputedStyle(tried).color;
  });
  tried.remove();
  return found;
}
