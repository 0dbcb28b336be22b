/** Of every page: the service worker, so that a device can install the console, and the keys of the palette. */

import { opensPalette } from "../palette/opener.js";

/** @param {string} url of the service worker */
export async function install(url) {
  try {
    await navigator.serviceWorker?.register(url);
  } catch {
    // Service workers need https or localhost, and a person may forbid them. The pages work the same without.
  }
}

const link = document.querySelector("link[data-service-worker]");
if (link) install(link.dataset.serviceWorker);

const opener = document.querySelector("[data-palette-module]");
if (opener)
  opensPalette(opener, async () => (await import(opener.dataset.paletteModule)).togglePalette());
