/**
 * This tab's token and clock. A reload keeps both: a lease belongs to a tab, and the times of the tab's
 * commands must never go back.
 */

import { recallInTab, rememberInTab } from "./prefs.js";

const TOKEN = "tab-token";
const ORIGIN = "tab-origin";
const DUPLICATE_AFTER_MS = 400;

/** 128 random bits as URL-safe text. */
export function randomToken() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

function remembered(key, make) {
  const value = recallInTab(key) ?? make();
  rememberInTab(key, value);
  return value;
}

/**
 * The tab's token. Browsers copy a tab's storage when a person duplicates the tab: the copy finds the
 * token's lock taken and makes a new token. All scripts of a page share it, because they share the lock.
 * @returns {Promise<string>}
 */
export function tabToken() {
  window.tabToken ??= ownToken();
  return window.tabToken;
}

async function ownToken() {
  const token = remembered(TOKEN, randomToken);
  if (!navigator.locks || (await holdLock(token))) return token;
  rememberInTab(TOKEN, null);
  return ownToken();
}

/** Takes the lock of a name for as long as this page lives. @returns {Promise<boolean>} */
function holdLock(name) {
  const whileThisPageLives = new Promise(() => {});
  return new Promise((resolve) => {
    navigator.locks
      .request(name, { signal: AbortSignal.timeout(DUPLICATE_AFTER_MS) }, () => {
        resolve(true);
        return whileThisPageLives;
      })
      .catch(() => resolve(false));
  });
}

/** Return a clock: milliseconds since this tab first opened a page here. Reloads do not set it back. */
export function tabClock() {
  const origin = Number(remembered(ORIGIN, () => String(performance.timeOrigin)));
  const offset = Math.max(performance.timeOrigin - origin, 0);
  return () => offset + performance.now();
}
