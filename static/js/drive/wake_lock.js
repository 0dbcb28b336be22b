/** Keeps the screen on while a person drives, where the browser allows it. */

/** @returns {{keep: (on: boolean) => void, close: () => void}} */
export function screenLock() {
  let wanted = false;
  let sentinel = null;

  const obtain = async () => {
    if (!wanted || sentinel || document.hidden || !navigator.wakeLock) return;
    try {
      const obtained = await navigator.wakeLock.request("screen");
      if (!wanted || sentinel) return void obtained.release();
      sentinel = obtained;
      obtained.addEventListener("release", () => {
        if (sentinel === obtained) sentinel = null;
      });
    } catch {
      // A low battery or the person's settings forbid it; driving works without it.
    }
  };
  const keep = (on) => {
    wanted = on;
    if (on) return void obtain();
    sentinel?.release();
    sentinel = null; // its "release" event comes later, perhaps after the next keep(true)
  };
  // The browser releases the lock when the page is hidden.
  document.addEventListener("visibilitychange", obtain);
  return {
    keep,
    close() {
      document.removeEventListener("visibilitychange", obtain);
      keep(false);
    },
  };
}
