/** The page for offline stands at the address that was asked for: it looks for the console, and then gives way. */

const EVERY_MS = 5000;

async function look() {
  try {
    await fetch("/livez", { cache: "no-store" });
    location.reload();
  } catch {
    // Still offline.
  }
}

setInterval(look, EVERY_MS);
window.addEventListener("online", look);
