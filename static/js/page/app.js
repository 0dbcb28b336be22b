/** Lets a device install the console, and say so when it is offline. */

/** @param {string} url of the service worker */
export async function install(url) {
  try {
    await navigator.serviceWorker?.register(url);
  } catch {
    // Only on https and on this computer itself, and a person may forbid it: the pages are the same without.
  }
}

const link = document.querySelector("link[data-service-worker]");
if (link) install(link.dataset.serviceWorker);
