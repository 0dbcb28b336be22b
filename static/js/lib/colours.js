/** The style sheet's colours, for canvases, which a style sheet cannot colour. */

/**
 * @param {HTMLElement} element
 * @param {string[]} names of custom properties
 * @returns {string[]} for a canvas
 */
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

/**
 * Call `repaint` when the page turns light or dark, by its menu or with the device.
 * @param {AbortSignal} signal ends it
 */
export function onNewColours(repaint, signal) {
  document.addEventListener("fleet:theme", repaint, { signal });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint, { signal });
}
