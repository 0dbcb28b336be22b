/**
 * A person's choices on this device, and a tab's data that a reload keeps. Storage may be forbidden or full.
 */

const KEY = "fleet-console";
let chosen = null;
const unsaved = {};

function tried(act) {
  try {
    return act();
  } catch {
    return null;
  }
}

function stored() {
  return tried(() => JSON.parse(localStorage.getItem(KEY))) ?? {};
}

function all() {
  chosen ??= stored();
  return chosen;
}

export function recall(name, fallback) {
  return all()[name] ?? fallback;
}

/** Store a choice, or keep it until the page closes. Choices that other scripts and tabs stored are kept. */
export function remember(name, value) {
  unsaved[name] = value;
  chosen = { ...all(), ...stored(), ...unsaved };
  tried(() => {
    localStorage.setItem(KEY, JSON.stringify(chosen));
    for (const saved of Object.keys(unsaved)) delete unsaved[saved];
  });
}

/** @returns {string | null} null: nothing is stored */
export function recallInTab(key) {
  return tried(() => sessionStorage.getItem(key));
}

/** @param {string} key @param {string | null} value null forgets it */
export function rememberInTab(key, value) {
  tried(() =>
    value === null ? sessionStorage.removeItem(key) : sessionStorage.setItem(key, value),
  );
}
