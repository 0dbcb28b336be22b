/** Why a grip ended, in words for the person whose hand it was. */

/** @param {{reason: string, patienceMs: number}} lost of the watch. @returns {?string} null: the person knows */
export function lostText({ reason, patienceMs }) {
  switch (reason) {
    case "silent":
      return interpolate(
        gettext("Input ended: no sign of a hand for %(seconds)s s. Let go, then go on."),
        { seconds: patienceMs / 1000 },
        true,
      );
    case "repeat-ended":
      return gettext("Input ended: the key was no longer reported. Press it again.");
    case "only-repeats":
      return gettext("Input ended: the key was held for 30 s. Press it again.");
    case "stood-still":
      return gettext("Input ended: this page stood still for a moment. Let go, then go on.");
    case "button":
    case "menu":
      return gettext("Input ended: only the main button moves the robot, and no menu.");
    case "modifier":
      return gettext("Input ended: nothing moves while Ctrl, Alt or Cmd is down.");
    case "blurred":
    case "dialog":
    case "drag":
    case "hidden":
    case "taken":
    case "text":
      return gettext("Input ended: something else took the mouse, the finger or the keys.");
    case "resized":
      return gettext("Input ended: the page changed its size. Let go, then go on.");
    default:
      return null;
  }
}

/** Says why a key or stick moves nothing beside an open dialog. */
export function barredText() {
  return gettext(
    "Close the dialog first: while it is open, keys and sticks move nothing. STOP works.",
  );
}

/** Asks for a sign of the hand, because no event has proven a grip for some time. */
export function soonText() {
  return gettext("Still there? Move your hand a little, or press the key again.");
}
