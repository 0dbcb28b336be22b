/** Presses that a person did not mean for the button that gets them. */

/** The second of two quick taps must not press a button that the first one brought under the finger. */
export const TWO_TAPS_MS = 500;

/** Listener for "keydown": a held Enter presses once. */
export function heldOnce(event) {
  if (event.key !== "Enter" || !event.repeat) return;
  event.preventDefault();
  event.stopPropagation();
}
