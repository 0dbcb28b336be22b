/** A person's choices on this device, and a tab's data over a reload. Storage may be forbidden or full. */

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

/** A choice that cannot be stored holds until the page closes. Choices of other scripts and tabs stay. */
export function remember(name, value) {
  unsaved[name] = value;
  chosen = { ...all(), ...stored(), ...unsaved };
  tried(() => {
    localStorage.setItem(KEY, JSON.stringify(chosen));
    for (const saved of Object.keys(unsaved)) delete unsaved[saved];
  });
}

/** @returns {string | null} null: nothing is kept */
export function recallInTab(key) {
  return tried(() => sessionStorage.getItem(key));
}

/** @param {string} key @param {string | null} value null forgets it */
export function rememberInTab(key, value) {
  tried(() =>
    value === null ? sessionStorage.removeItem(key) : sessionStorage.setItem(key, value),
  );
}
