/** Driving by keys: WASD and arrows, Q and E to slide, Space to stop, T to take control. A key counts by its position, not by its letter. */

import { HeldKeys } from "../../hand/held_keys.js";
import { isModified } from "../../hand/watch.js";
import { isEditing, isField } from "../../lib/editing.js";
import { NEUTRAL } from "./stick.js";

const INPUT = "keyboard";

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

/**
 * Listens for keys on the window. Keys act only while the host allows it.
 * @param {object} host
 * @param {import("./stick.js").Stick} host.stick
 * @param {() => boolean} host.holonomic
 * @param {() => boolean} host.drives this person has control, and the joystick is shown
 * @param {() => void} host.refused a key was pressed to drive, and this person has no control
 * @param {() => void} host.take the person asks for control by its key
 * @param {() => boolean} host.mayStop this person has control, as far as the page knows: also while the
 *   connection is lost
 * @param {() => void} host.stop
 * @returns {() => void} ends it
 */
export function listenToKeys({ stick, holonomic, drives, refused, take, mayStop, stop }) {
  const listening = new AbortController();
  const { signal } = listening;
  const keys = new HeldKeys(window, Object.keys(AXES), drives, (held, lost) => {
    if (lost && stick.input === INPUT) stick.neutralise(lost);
    stick.feed(INPUT, axesOf(held, holonomic()));
  });

  const down = (event) => {
    // A slider uses the arrow keys, but not the space bar: a space stops from there as well.
    const slides = event.target?.type === "range";
    const isFree = !event.repeat && !isModified(event) && !isEditing(event.target) && !slides;
    if (isFree && /^Key[WASDQE]$/.test(event.code) && !drives()) refused();
    if (isFree && event.code === "KeyT" && !event.defaultPrevented) take(); // the 3D view has a T of its own
    // In a dialog, too, where Enter presses the buttons.
    if (event.code !== "Space" || (isField(event.target) && !slides)) return;
    if (isModified(event) || !mayStop()) return;
    event.preventDefault();
    if (!event.repeat) stop();
  };
  const up = (event) => {
    // Without this, the same space would also press a focused button.
    if (event.code === "Space" && mayStop() && !isField(event.target)) event.preventDefault();
  };

  window.addEventListener("keydown", down, { signal });
  window.addEventListener("keyup", up, { signal });
  return () => {
    listening.abort();
    keys.close();
  };
}
