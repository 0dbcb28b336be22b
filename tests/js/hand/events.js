/** Events of a hand, as browsers send them. */

const LIFTED = ["pointerup", "pointercancel", "lostpointercapture"];

/** Return a pointer event: of the main mouse button, unless `facts` say otherwise. */
export function pointerEvent(type, facts = {}) {
  const event = new Event(type, { bubbles: true, cancelable: true });
  const buttons = LIFTED.includes(type) ? 0 : 1;
  const [screenX, screenY] = [facts.clientX ?? 0, facts.clientY ?? 0];
  const said = { pointerId: 1, button: 0, buttons, screenX, screenY, ...facts };
  for (const [name, value] of Object.entries(said))
    Object.defineProperty(event, name, { value, configurable: true });
  return event;
}

/** Send one pointer event, and return it. */
export function point(target, type, facts = {}) {
  const event = pointerEvent(type, facts);
  target.dispatchEvent(event);
  return event;
}

/** Send one event of a key. */
export function type(target, kind, code, facts = {}) {
  const event = new KeyboardEvent(kind, { code, bubbles: true, cancelable: true, ...facts });
  target.dispatchEvent(event);
  return event;
}
