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

/** Whenever the page turns light or dark, by its menu or with the device. @param {AbortSignal} signal until then */
export function onNewColours(repaint, signal) {
  document.addEventListener("fleet:theme", repaint, { signal });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint, { signal });
}
