import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { firstPad, listenToGamepad } from "../../../../static/js/drive/input/gamepad.js";
import { NEUTRAL, Stick } from "../../../../static/js/drive/input/stick.js";

const pushed = () => ({ connected: true, axes: [0, -1, 0, 0], buttons: [{}, { pressed: false }] });

describe("the choice of gamepad", () => {
  it("takes the first that is connected and has a stick", () => {
    const pad = pushed();
    const unplugged = { connected: false, axes: [0, 0] };
    const buttonsOnly = { connected: true, axes: [] };
    expect(firstPad([null, unplugged, buttonsOnly, pad])).toBe(pad);
    expect(firstPad([null])).toBeNull();
  });
});

describe("a gamepad", () => {
  let pads;
  let stick;
  let stop;
  let mayStop;
  let end;
  const frame = () => vi.advanceTimersByTime(20);

  beforeEach(() => {
    vi.useFakeTimers();
    pads = [pushed()];
    vi.stubGlobal("navigator", { getGamepads: () => pads });
    stick = new Stick();
    stop = vi.fn();
    mayStop = true;
    end = listenToGamepad({ stick, holonomic: () => false, mayStop: () => mayStop, stop });
    frame();
  });

  afterEach(() => {
    end();
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  it("drives", () => {
    expect(stick.axes.x).toBe(1);
    expect(stick.input).toBe("gamepad");
  });

  it("rests when it is unplugged", () => {
    pads = [null];
    frame();
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("stops by its button once per press, only with control", () => {
    pads[0].buttons[1].pressed = true;
    frame();
    frame();
    expect(stop).toHaveBeenCalledTimes(1);
    pads[0].buttons[1].pressed = false;
    frame();
    mayStop = false;
    pads[0].buttons[1].pressed = true;
    frame();
    expect(stop).toHaveBeenCalledTimes(1);
  });

  it("is not read after close", () => {
    end();
    pads[0].axes = [0, 0, 0, 0];
    frame();
    expect(stick.axes.x).toBe(1);
  });
});
