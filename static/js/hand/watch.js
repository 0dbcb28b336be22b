/**
 * The page's watch on the hand: each input that moves a robot only while it is held is a grip of this watch.
 *
 * A grip ends when the hand may be gone: a menu, another button, a modifier key, a dialog, a drag, the window's focus,
 * a page that stood still; or when no event has proven it for too long (`proof.js`).
 */

import { isEditing, takesText } from "../lib/editing.js";
import { PATIENCE_MS, Proof } from "./proof.js";

const TICK_MS = 100;
const STOOD_STILL_MS = 1_000; // between two looks at the clocks: the page was frozen, or the computer slept
const FUNCTION_KEY = /^F\d+$/; // the browser's or the window system's: F10 opens Firefox's menu bar, without a blur
const MODIFIERS = new Set(["Meta", "OS", "Control", "Alt", "AltGraph", "Hyper", "Super"]);

/** Return whether a modifier key is down. macOS sends no release of a key while Cmd is down. */
export function isModified(event) {
  return (
    event.metaKey ||
    event.ctrlKey ||
    event.altKey ||
    ["OS", "AltGraph"].some((key) => event.getModifierState?.(key))
  );
}

/** Return whether an input method takes this key to compose a text: Chromium then withholds releases of other keys. */
export function isComposing(event) {
  return event.isComposing || event.keyCode === 229 || event.key === "Dead";
}

/** Return whether a dialog of the page is open. It need not have the focus: a press beside it leaves it open. */
export function isDialogOpen() {
  return document.querySelector("dialog[open]") !== null;
}

/**
 * Events: "lost" (detail: {reason, patienceMs}) when a grip ended without the hand; "interrupted" (detail: {reason})
 * when the page itself was left or stood still, also without a grip; "soon" (detail: boolean) when a grip needs a sign
 * of the hand; "barred" when a grip did not begin, because a dialog is open.
 */
class HandWatch extends EventTarget {
  #grips = new Map(); // what `begin` got → its proof
  #timer = null;
  #lookedMs = 0;
  #wallMs = 0;
  #hadFocus = false;
  #soon = false;

  constructor() {
    super();
    const on = (target, type, reason, means = () => true) =>
      target.addEventListener(type, (event) => means(event) && this.#loseHand(reason));
    const left = (target, type, reason) =>
      target.addEventListener(type, () => this.#interrupt(reason));
    left(window, "blur", "blurred"); // the window's own: that of an element does not bubble
    // Chromium pauses a page that prints: listeners of the page's own events would not hear of the end.
    window.addEventListener("beforeprint", () => setTimeout(() => this.#interrupt("dialog")));
    left(window, "pagehide", "hidden");
    left(document, "visibilitychange", "hidden");
    for (const type of ["freeze", "resume"]) left(document, type, "stood-still");
    // A stick prevents its menu, because a long touch would open it.
    on(window, "contextmenu", "menu", ({ defaultPrevented }) => !defaultPrevented);
    on(window, "pointerdown", "button", ({ button }) => button > 0);
    on(window, "auxclick", "button");
    for (const type of ["dragstart", "dragenter"]) on(window, type, "drag");
    on(window, "keydown", "modifier", (event) => isModified(event) || MODIFIERS.has(event.key));
    on(window, "keydown", "text", isComposing);
    on(window, "keydown", "taken", ({ key }) => FUNCTION_KEY.test(key));
    on(window, "compositionstart", "text");
    // A release may have waited while the page stood still: it says nothing of what the hand wants now.
    for (const type of ["pointermove", "pointerup", "keydown", "keyup"])
      window.addEventListener(type, () => this.#stoodStill(), { capture: true });
    document.addEventListener("focusin", ({ target }) => {
      // Another finger may slide or tick; but a slider takes the keys, too.
      if (isEditing(target)) this.#loseHand("text", (grip) => grip.usesKeys || takesText(target));
    });
    const opens = ({ target, newState }) => target.nodeName === "DIALOG" && newState === "open";
    document.addEventListener("toggle", (e) => opens(e) && this.#loseAll("dialog"), {
      capture: true,
    });
  }

  /** Return whether a grip may begin: a key, stick or gamepad moves nothing while a dialog is open. */
  admit() {
    if (!isDialogOpen()) return true;
    this.#emit("barred");
    return false;
  }

  /**
   * Begin a grip.
   * @param {{lose: (reason: string) => void, withoutHand?: boolean, usesKeys?: boolean}} grip `lose` is called when the
   *   grip has ended for a reason of the watch; a grip `withoutHand` needs only the page
   * @param {number} [patienceMs] how long it counts without a proof
   */
  begin(grip, patienceMs = PATIENCE_MS) {
    const now = performance.now();
    this.#grips.set(grip, new Proof(now, patienceMs));
    if (this.#timer !== null) return;
    this.#hadFocus = document.hasFocus();
    [this.#lookedMs, this.#wallMs] = [now, Date.now()];
    this.#timer = setInterval(() => this.#tick(), TICK_MS);
  }

  /** An event of the hand proves the grip. @param {{repeat?: boolean}} [event] a repeat of a held key */
  prove(grip, { repeat = false } = {}) {
    const proof = this.#grips.get(grip);
    if (repeat) proof?.repeat(performance.now());
    else proof?.renew(performance.now());
  }

  /** Another key than that of the grip was pressed or released. */
  expectNoRepeat(grip) {
    this.#grips.get(grip)?.expectNoRepeat();
  }

  end(grip) {
    this.#grips.delete(grip);
    if (this.#grips.size > 0) return;
    clearInterval(this.#timer);
    this.#timer = null;
    this.#say(false);
  }

  /** Another element takes the keys: those that are held move nothing more. */
  loseKeys() {
    this.#loseHand("text", (grip) => grip.usesKeys);
  }

  /** End a grip that a door itself finds lost. */
  lose(grip, reason) {
    const proof = this.#grips.get(grip);
    if (!proof) return;
    this.end(grip);
    grip.lose(reason);
    this.#emit("lost", { reason, patienceMs: proof.patienceMs });
  }

  /** End all grips if the page stood still since it last looked at the clocks. */
  #stoodStill() {
    if (this.#timer === null) return false;
    const [now, wall] = [performance.now(), Date.now()];
    // While a computer sleeps, some systems let only the clock on the wall go on.
    const gapMs = Math.max(now - this.#lookedMs, wall - this.#wallMs);
    [this.#lookedMs, this.#wallMs] = [now, wall];
    if (gapMs <= STOOD_STILL_MS) return false;
    this.#interrupt("stood-still");
    return true;
  }

  #tick() {
    if (this.#stoodStill()) return;
    const now = performance.now();
    this.#hadFocus ||= document.hasFocus(); // the press itself may have brought the focus
    if (this.#hadFocus && !document.hasFocus()) return this.#interrupt("blurred");
    if (isDialogOpen()) return this.#loseAll("dialog");
    for (const [grip, proof] of this.#grips) {
      const reason = proof.failure(now);
      if (reason) this.lose(grip, reason);
    }
    this.#say([...this.#grips.values()].some((proof) => proof.isSoonOver(now)));
  }

  #interrupt(reason) {
    this.#loseAll(reason);
    this.#emit("interrupted", { reason });
  }

  #loseHand(reason, means = () => true) {
    this.#loseAll(reason, (grip) => !grip.withoutHand && means(grip));
  }

  #loseAll(reason, means = () => true) {
    for (const grip of [...this.#grips.keys()]) if (means(grip)) this.lose(grip, reason);
  }

  #say(soon) {
    if (soon === this.#soon) return;
    this.#soon = soon;
    this.#emit("soon", soon);
  }

  #emit(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}

/** The watch of this page. A page has one, because it has one window and one focus. */
export const hand = new HandWatch();
