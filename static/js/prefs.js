/** What a person chose on this device. A browser may forbid storage: then a choice lasts for the page. */

const KEY = "fleet-console";
let chosen = null;

function all() {
  if (chosen) return chosen;
  try {
    chosen = JSON.parse(localStorage.getItem(KEY)) ?? {};
  } catch {
    chosen = {};
  }
  return chosen;
}

export function recall(name, fallback) {
  return all()[name] ?? fallback;
}

export function remember(name, value) {
  all()[name] = value;
  try {
    localStorage.setItem(KEY, JSON.stringify(chosen));
  } catch {
    // Storage is full or forbidden: the choice holds until the page closes.
  }
}
