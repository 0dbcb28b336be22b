/**
 * Of every page: the service worker, so that a device can install the console and get notifications, and the keys of
 * the palette.
 */

import { opensPalette } from "../palette/opener.js";

/** @param {string} url of the service worker */
export async function install(url) {
  try {
    await navigator.serviceWorker?.register(url);
  } catch {
    // Service workers need https or localhost, and a person may forbid them. The pages work the same without.
  }
}

const FORGETS_MS = 1000; // a browser that does not answer keeps nobody signed in

/** End the notifications of this browser: somebody else may use it next. */
async function forget() {
  const registration = await navigator.serviceWorker?.getRegistration();
  const subscription = await registration?.pushManager.getSubscription();
  await subscription?.unsubscribe();
}

/** @param {SubmitEvent} event of the form that signs out */
export async function signOut(event) {
  if (globalThis.Notification?.permission !== "granted") return;
  event.preventDefault();
  const late = new Promise((end) => setTimeout(end, FORGETS_MS));
  await Promise.race([forget().catch(() => null), late]);
  event.target.submit();
}

document.querySelector("[data-signs-out]")?.addEventListener("submit", signOut);

const link = document.querySelector("link[data-service-worker]");
if (link) install(link.dataset.serviceWorker);

const opener = document.querySelector("[data-palette-module]");
if (opener)
  opensPalette(opener, async () => (await import(opener.dataset.paletteModule)).togglePalette());
