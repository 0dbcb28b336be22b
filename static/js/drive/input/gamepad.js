/** Gamepads as input: read once per frame, only while one is connected. */

import { hand } from "../../hand/watch.js";
import { fromGamepad } from "./shaping.js";
import { isNeutral, NEUTRAL } from "./stick.js";

const NOISE = 0.02; // share of full stick: a stick that an object holds is not quite still
const STOP_BUTTON = 1; // B on an Xbox pad, circle on a PlayStation pad

/**
 * One device. It drives only after it has been in the middle: a device that is plugged in may rest anywhere. A device
 * that the browser does not know as a gamepad may be a sensor that drifts: a person takes it into use by a button.
 *
 * Each change of what steers, and each press of a button, proves the hand. Other axes, triggers that are not pressed
 * and the time stamp prove nothing: they change without a hand.
 */
export class Pad {
  #input;
  #stick;
  #inUse = false;
  #rested = false;
  // A switch that is on when the device is plugged in is not pressed by a person.
  #wasPressed = true;
  #stopWasDown = true;
  #seen = []; // when the hand was last proven
  #isHeld = false;

  /** @param {import("./stick.js").Stick} stick @param {string} name of the device */
  constructor(stick, name) {
    this.#stick = stick;
    this.#input = `gamepad ${name}`;
  }

  /** @param {Gamepad} pad as it is now */
  read(pad, holonomic) {
    if (!this.#isInUse(pad)) return;
    const axes = fromGamepad(pad.axes, holonomic);
    const neutral = isNeutral(axes);
    this.#rested ||= neutral;
    if (neutral) return this.#rest();
    if (!this.#rested) return;
    if (!this.#isHeld && !hand.admit()) return this.leave();
    this.#prove([...Object.values(axes), ...pad.buttons.map(({ pressed }) => Number(pressed))]);
    this.#stick.feed(this.#input, axes);
  }

  /** @param {number[]} seen what steers, and which buttons are pressed */
  #prove(seen) {
    const isNew = seen.some((value, at) => Math.abs(value - this.#seen[at]) >= NOISE);
    if (this.#isHeld && !isNew) return;
    if (this.#isHeld) hand.prove(this);
    else hand.begin(this);
    this.#isHeld = true;
    this.#seen = seen;
  }

  /** Drive no more until the device has been in the middle. @param {string} reason called by the watch */
  lose(reason) {
    this.#isHeld = this.#rested = false;
    if (this.#stick.input === this.#input) this.#stick.neutralise(reason);
  }

  /** Return whether the stop button was pressed since the last call. */
  pressesStop({ buttons }) {
    const isDown = Boolean(buttons[STOP_BUTTON]?.pressed);
    const presses = isDown && !this.#stopWasDown;
    this.#stopWasDown = isDown;
    return presses;
  }

  /** The page does not hear the device: it must be in the middle before it drives again. */
  leave() {
    this.#rested = false;
    this.#rest();
  }

  #rest() {
    this.#isHeld = false;
    hand.end(this);
    this.#stick.feed(this.#input, NEUTRAL);
  }

  #isInUse(pad) {
    const pressed = pad.buttons.some((button) => button.pressed);
    this.#inUse ||= pad.mapping === "standard" || (pressed && !this.#wasPressed);
    this.#wasPressed = pressed;
    return this.#inUse;
  }
}

/** Return what a device needs before it drives. @param {Gamepad} pad */
function connectedText({ mapping }) {
  return mapping === "standard"
    ? gettext(
        "A gamepad is connected. Take control, let its sticks rest: then its left stick drives, and B or circle stops.",
      )
    : gettext(
        "A device is connected that the browser does not know as a gamepad. To drive with it, take control and press one of its buttons.",
      );
}

/**
 * @param {object} host
 * @param {import("./stick.js").Stick} host.stick
 * @param {() => boolean} host.holonomic
 * @param {() => boolean} host.mayStop this person has control, as far as the page knows: also while the
 *   connection is lost
 * @param {() => void} host.stop
 * @param {(text: string) => void} host.notify
 * @returns {() => void} ends it
 */
export function listenToGamepads({ stick, holonomic, mayStop, stop, notify }) {
  if (!navigator.getGamepads) return () => {}; // browsers offer none to plain http pages of another host
  const listening = new AbortController();
  const { signal } = listening;
  const pads = new Map(); // by place and name of the device
  let frame = null;

  const padOf = ({ index, id }) => {
    const key = `${index} ${id}`;
    if (!pads.has(key)) pads.set(key, new Pad(stick, key));
    return pads.get(key);
  };
  const look = () => {
    const devices = [...navigator.getGamepads()].filter((device) => device?.connected);
    const found = new Map(devices.map((device) => [padOf(device), device]));
    for (const [key, pad] of pads) {
      const device = found.get(pad);
      // Without the focus, another program may use the device; it still stops.
      if (device && document.hasFocus()) pad.read(device, holonomic());
      else pad.leave();
      if (!device) pads.delete(key);
      else if (pad.pressesStop(device) && mayStop()) stop();
    }
    frame = devices.length > 0 ? requestAnimationFrame(look) : null;
  };
  const leave = () => {
    for (const pad of pads.values()) pad.leave();
  };
  const begin = () => {
    if (frame === null) frame = requestAnimationFrame(look);
  };

  const connected = ({ gamepad }) => {
    notify(connectedText(gamepad));
    begin();
  };
  const gone = () => {
    notify(gettext("The gamepad is gone. To drive with it again, switch it on or plug it in."));
    begin();
  };

  window.addEventListener("gamepadconnected", connected, { signal });
  window.addEventListener("gamepaddisconnected", gone, { signal });
  hand.addEventListener("interrupted", leave, { signal });
  begin();
  return () => {
    listening.abort();
    cancelAnimationFrame(frame);
    leave();
  };
}
