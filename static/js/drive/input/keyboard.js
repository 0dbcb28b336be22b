/** Driving by keys: WASD and arrows, Q and E to slide. A key counts by its position, not by its letter. */

import { NEUTRAL } from "./stick.js";

const AXES = {
  KeyW: { x: 1 },
  ArrowUp: { x: 1 },
  KeyS: { x: -1 },
  ArrowDown: { x: -1 },
  KeyA: { w: 1 },
  ArrowLeft: { w: 1 },
  KeyD: { w: -1 },
  ArrowRight: { w: -1 },
  KeyQ: { y: 1 },
  KeyE: { y: -1 },
};

/** The axes for a set of held keys; opposite keys cancel. */
export function axesOf(held, holonomic) {
  const sum = { x: 0, y: 0, w: 0 };
  for (const code of held) {
    for (const [axis, value] of Object.entries(AXES[code] ?? {})) sum[axis] += value;
  }
  const axes = {
    x: Math.sign(sum.x),
    y: holonomic ? Math.sign(sum.y) : 0,
    w: Math.sign(sum.w),
  };
  return axes.x || axes.y || axes.w ? axes : NEUTRAL;
}

/** Return whether an element uses the keys itself: a field, a list, an open dialog. */
export function isEditing(target) {
  return Boolean(
    target?.closest?.(
      "input, textarea, select, dialog[open], [contenteditable]:not([contenteditable='false'])",
    ),
  );
}

/**
 * Listens for keys on the window. Keys act only while the host allows it.
 * @param {object} host
 * @param {import("./stick.js").Stick} host.stick
 * @param {() => boolean} host.holonomic
 * @param {() => boolean} host.drives this person has control, and the joystick is shown
 * @param {() => boolean} host.mayStop this person has control, as far as the page knows: also while the
 *   connection is lost
 * @param {() => void} host.stop
 * @returns {() => void} ends it
 */
export function listenToKeys({ stick, holonomic, drives, mayStop, stop }) {
  const held = new Set();
  const listening = new AbortController();
  const { signal } = listening;
  const feed = () => stick.feed("keyboard", axesOf(held, holonomic()));

  const down = (event) => {
    // A slider uses the arrow keys, but not the space bar: a space stops from there as well.
    const slides = event.code === "Space" && event.target?.type === "range";
    if (isEditing(event.target) && !slides) return;
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.code === "Space" && mayStop()) {
      event.preventDefault();
      if (!event.repeat) stop();
    } else if (event.code in AXES && drives()) {
      event.preventDefault();
      held.add(event.code);
      feed();
    }
  };
  const up = (event) => {
    // Without this, the same space would also press a focused button.
    if (event.code === "Space" && mayStop() && !isEditing(event.target)) event.preventDefault();
    if (held.delete(event.code)) feed();
  };
  const forget = () => {
    held.clear();
    feed();
  };

  window.addEventListener("keydown", down, { signal });
  window.addEventListener("keyup", up, { signal });
  // Without the focus, the page does not receive the release of a key.
  window.addEventListener("blur", forget, { signal });
  document.addEventListener("visibilitychange", forget, { signal });
  document.addEventListener("focusin", (event) => isEditing(event.target) && forget(), { signal });
  return () => {
    listening.abort();
    forget();
  };
}
