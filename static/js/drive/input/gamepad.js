/** A gamepad as input: read once per frame, only while one is connected. */

import { fromGamepad } from "./shaping.js";
import { NEUTRAL } from "./stick.js";

const STOP_BUTTON = 1; // B on an Xbox pad, circle on a PlayStation pad

/** The pad that drives: the first that is connected and has a standard stick. */
export function firstPad(pads) {
  return [...pads].find((pad) => pad?.connected && pad.axes.length >= 2) ?? null;
}

/**
 * @param {object} host
 * @param {import("./stick.js").Stick} host.stick
 * @param {() => boolean} host.holonomic
 * @param {() => boolean} host.mayStop this person has control, as far as the page knows: also while the
 *   connection is lost
 * @param {() => void} host.stop
 * @returns {() => void} ends it
 */
export function listenToGamepad({ stick, holonomic, mayStop, stop }) {
  if (!navigator.getGamepads) return () => {}; // browsers offer none to plain http pages of another host
  const listening = new AbortController();
  const { signal } = listening;
  let frame = null;
  let stopWasDown = false;

  const look = () => {
    frame = null;
    const pad = firstPad(navigator.getGamepads());
    if (!pad) {
      stick.feed("gamepad", NEUTRAL);
      return;
    }
    stick.feed("gamepad", fromGamepad(pad.axes, holonomic()));
    const stopIsDown = Boolean(pad.buttons[STOP_BUTTON]?.pressed);
    if (stopIsDown && !stopWasDown && mayStop()) stop();
    stopWasDown = stopIsDown;
    frame = requestAnimationFrame(look);
  };
  const begin = () => {
    if (frame === null) frame = requestAnimationFrame(look);
  };

  window.addEventListener("gamepadconnected", begin, { signal });
  window.addEventListener("gamepaddisconnected", begin, { signal });
  begin();
  return () => {
    listening.abort();
    cancelAnimationFrame(frame);
  };
}
