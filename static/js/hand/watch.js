/**
 * The page's watch on the hand: everything that moves a robot only while it is held is a hold of this watch.
 *
 * A hold ends when the hand may be gone: a menu, another button, a modifier key, a dialog, a drag, the window's focus,
 * a page that stood still; or when no event has proven it for too long (`proof.js`).
 */

import { isEditing } from "../lib/editing.js";
import { PATIENCE_MS, Proof } from "./proof.js";

const TICK_MS = 100;
const STOOD_STILL_MS = 1_000; // between two ticks: the page was frozen, or the computer slept
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

/** Return whether an input method takes this key to compose a text. */
export function isComposing(event) {
  return event.isComposing || event.keyCode === 229;
}

/**
 * Events: "lost" (detail: {reason, patienceMs}) when a hold ended without the hand; "interrupted" (detail: {reason}) when the page
 * itself was left or stood still, also without a hold; "soon" (detail: boolean) when a hold needs a sign of the hand.
 */
class HandWatch extends EventTarget {
  #holds = new Map(); // what `begin` got → its proof
  #timer = null;
  #tickMs = 0;
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
    left(window, "beforeprint", "dialog");
    left(window, "pagehide", "hidden");
    left(document, "visibilitychange", "hidden");
    for (const type of ["freeze", "resume"]) left(document, type, "stood-still");
    // A long touch of a stick opens no menu: the stick prevents it.
    on(window, "contextmenu", "menu", (e) => !(e.pointerType === "touch" && e.defaultPrevented));
    on(window, "pointerdown", "button", ({ button }) => button > 0);
    on(window, "auxclick", "button");
    for (const type of ["dragstart", "dragenter"]) on(window, type, "drag");
    on(window, "keydown", "modifier", (event) => isModified(event) || MODIFIERS.has(event.key));
    on(window, "keydown", "text", isComposing);
    on(window, "compositionstart", "text");
    on(document, "focusin", "text", ({ target }) => isEditing(target));
    const opens = ({ target, newState }) => target.nodeName === "DIALOG" && newState === "open";
    document.addEventListener("toggle", (e) => opens(e) && this.#loseHand("dialog"), {
      capture: true,
    });
  }

  /**
   * Begin a hold.
   * @param {{lose: (reason: string) => void, withoutHand?: boolean}} hold `lose` is called when the hold has ended for
   *   a reason of the watch; a hold `withoutHand` needs only the page
   * @param {number} [patienceMs] how long it counts without a proof
   */
  begin(hold, patienceMs = PATIENCE_MS) {
    const now = performance.now();
    this.#holds.set(hold, new Proof(now, patienceMs));
    if (this.#timer !== null) return;
    this.#hadFocus = document.hasFocus();
    [this.#tickMs, this.#wallMs] = [now, Date.now()];
    this.#timer = setInterval(() => this.#tick(), TICK_MS);
  }

  /** An event of the hand proves the hold. @param {{repeat?: boolean}} [event] a repeat of a held key */
  prove(hold, { repeat = false } = {}) {
    const proof = this.#holds.get(hold);
    if (repeat) proof?.repeat(performance.now());
    else proof?.renew(performance.now());
  }

  end(hold) {
    this.#holds.delete(hold);
    if (this.#holds.size > 0) return;
    clearInterval(this.#timer);
    this.#timer = null;
    this.#say(false);
  }

  /** End a hold that a door itself finds lost. */
  lose(hold, reason) {
    const proof = this.#holds.get(hold);
    if (!proof) return;
    this.end(hold);
    hold.lose(reason);
    this.#emit("lost", { reason, patienceMs: proof.patienceMs });
  }

  #tick() {
    const now = performance.now();
    // While a computer sleeps, some systems let only the clock go on.
    const gapMs = Math.max(now - this.#tickMs, Date.now() - this.#wallMs);
    [this.#tickMs, this.#wallMs] = [now, Date.now()];
    if (gapMs > STOOD_STILL_MS) return this.#interrupt("stood-still");
    if (this.#hadFocus && !document.hasFocus()) return this.#interrupt("blurred");
    for (const [hold, proof] of this.#holds) {
      const reason = proof.failure(now);
      if (reason) this.lose(hold, reason);
    }
    this.#say([...this.#holds.values()].some((proof) => proof.isSoonOver(now)));
  }

  #interrupt(reason) {
    for (const hold of [...this.#holds.keys()]) this.lose(hold, reason);
    this.#emit("interrupted", { reason });
  }

  #loseHand(reason) {
    for (const hold of [...this.#holds.keys()]) if (!hold.withoutHand) this.lose(hold, reason);
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

/** The watch of this page. */
export const hand = new HandWatch();
