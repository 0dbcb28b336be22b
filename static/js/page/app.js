/** Registers the service worker: a device can install the console, and has a page for offline. */

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
