/** The offline page, shown at the address that was opened: reloads as soon as the console can be reached. */

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
