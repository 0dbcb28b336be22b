import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { listenToGamepads } from "../../../../static/js/drive/input/gamepad.js";
import { NEUTRAL, Stick } from "../../../../static/js/drive/input/stick.js";

const AHEAD = [0, -1, 0, 0];
const MIDDLE = [0, 0, 0, 0];
const device = (index, facts = {}) => ({
  index,
  id: "pad",
  connected: true,
  mapping: "standard",
  axes: MIDDLE,
  buttons: [{ pressed: false }, { pressed: false }],
  ...facts,
});

describe("gamepads", () => {
  let pads;
  let stick;
  let stop;
  let mayStop;
  let end;
  let notify;
  const frame = (...axes) => {
    for (const [index, each] of axes.entries()) pads[index].axes = each;
    vi.advanceTimersByTime(20);
  };
  const pause = (ms) => vi.advanceTimersByTime(ms);

  beforeEach(() => {
    vi.useFakeTimers();
    vi.spyOn(document, "hasFocus").mockReturnValue(true);
    pads = [device(0)];
    vi.stubGlobal("navigator", { getGamepads: () => pads });
    stick = new Stick();
    stop = vi.fn();
    mayStop = true;
    notify = vi.fn();
    const host = { holonomic: () => false, mayStop: () => mayStop };
    end = listenToGamepads({ stick, stop, notify, ...host });
    frame(MIDDLE);
  });

  afterEach(() => {
    end();
    vi.unstubAllGlobals();
    vi.restoreAllMocks();
    vi.useRealTimers();
  });

  it("drive", () => {
    frame(AHEAD);
    expect(stick.axes.x).toBe(1);
    expect(stick.input).toBe("gamepad 0 pad");
  });

  it("say that they are there, what they need, and that they are gone", () => {
    const tell = (type, gamepad) =>
      window.dispatchEvent(Object.assign(new Event(type), { gamepad }));
    tell("gamepadconnected", pads[0]);
    expect(notify).toHaveBeenLastCalledWith(expect.stringContaining("Take control"));
    tell("gamepadconnected", device(1, { mapping: "" }));
    expect(notify).toHaveBeenLastCalledWith(expect.stringContaining("press one of its buttons"));
    tell("gamepaddisconnected", pads[0]);
    expect(notify).toHaveBeenLastCalledWith(expect.stringContaining("gone"));
  });

  it("rest when they are unplugged", () => {
    frame(AHEAD);
    pads = [null];
    frame();
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("drive also behind a device that is none, or that does not rest in the middle", () => {
    pads = [
      device(0, { id: "odd", mapping: "", axes: [0.7, -0.9] }),
      device(1, { axes: AHEAD }),
      device(2),
    ];
    frame();
    frame([0.6, -0.8], AHEAD);
    expect(stick.axes).toEqual(NEUTRAL);
    frame([0.6, -0.8], AHEAD, [0, 1, 0, 0]);
    expect([stick.axes.x, stick.input]).toEqual([-1, "gamepad 2 pad"]);
  });

  it("never drive by a device that drifts through the middle", () => {
    pads = [device(0, { id: "odd", mapping: "", buttons: [{ pressed: true }] })];
    for (const x of [0.9, 0.4, 0, -0.4, -0.9]) frame([x, x]);
    expect([stick.axes, stick.waitsForNeutral]).toEqual([NEUTRAL, false]);
  });

  it("drive by an unknown device after a person pressed one of its buttons", () => {
    pads = [device(0, { id: "odd", mapping: "" })];
    frame();
    pads[0].buttons = [{ pressed: true }];
    frame(MIDDLE);
    frame(AHEAD);
    expect(stick.axes.x).toBe(1);
  });

  it("rest if they report nothing new for 4 s, until they were in the middle", () => {
    frame(AHEAD);
    pause(3_500);
    frame([0, -0.97, 0, 0]); // a hand is not that still
    pause(3_500);
    expect(stick.axes.x).toBeGreaterThan(0.9);
    pause(700);
    expect(stick.axes).toEqual(NEUTRAL);
    frame([0, -0.9, 0, 0]);
    expect(stick.axes).toEqual(NEUTRAL);
    frame(MIDDLE);
    frame(AHEAD);
    expect(stick.axes.x).toBe(1);
  });

  it.each([
    ["an axis that does not steer", (noise) => ({ axes: [0, -1, 0, noise] })],
    ["the noise of the stick", (noise) => ({ axes: [0, -0.7 + noise, 0, 0] })],
    ["the noise of a stick in its dead zone", (noise) => ({ axes: [noise, -1, noise, 0] })],
    ["a trigger that is not pressed", (noise) => ({ buttons: [{ pressed: false, value: noise }] })],
  ])("are not proven by %s", (_, facts) => {
    frame(AHEAD);
    for (let ms = 0; ms < 4_400; ms += 20) {
      Object.assign(pads[0], { axes: AHEAD }, facts(ms % 40 === 0 ? 0.004 : -0.004));
      vi.advanceTimersByTime(20);
    }
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("are proven by the press of a button", () => {
    frame(AHEAD);
    pause(3_500);
    pads[0].buttons[0].pressed = true;
    frame(AHEAD);
    pause(3_500);
    expect(stick.axes.x).toBe(1);
  });

  it("rest without the focus, and afterwards until they were in the middle", () => {
    frame(AHEAD);
    document.hasFocus.mockReturnValue(false);
    frame(AHEAD);
    expect(stick.axes).toEqual(NEUTRAL);
    pads[0].buttons[1].pressed = true;
    frame(AHEAD);
    expect(stop).toHaveBeenCalledTimes(1); // the stop is heard
    document.hasFocus.mockReturnValue(true);
    frame(AHEAD);
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("stop by a button once per press, only with control", () => {
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

  it("are not read after close", () => {
    end();
    frame(AHEAD);
    expect(stick.axes).toEqual(NEUTRAL);
  });
});
