import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { axesOf, listenToKeys } from "../../../../static/js/drive/input/keyboard.js";
import { NEUTRAL, Stick } from "../../../../static/js/drive/input/stick.js";

describe("held keys", () => {
  it("mean the same as letters and as arrows", () => {
    expect(axesOf(["KeyW"], false)).toEqual(axesOf(["ArrowUp"], false));
    expect(axesOf(["KeyA"], false)).toEqual({ x: 0, y: 0, w: 1 });
    expect(axesOf(["ArrowDown", "ArrowRight"], false)).toEqual({ x: -1, y: 0, w: -1 });
  });

  it("cancel when opposite, do not add up when alike", () => {
    expect(axesOf(["KeyW", "KeyS"], false)).toBe(NEUTRAL);
    expect(axesOf(["KeyW", "ArrowUp"], false).x).toBe(1);
  });

  it("slide only a base that can", () => {
    expect(axesOf(["KeyQ"], true)).toEqual({ x: 0, y: 1, w: 0 });
    expect(axesOf(["KeyQ"], false)).toBe(NEUTRAL);
  });
});

describe("the keyboard", () => {
  let stick;
  let stop;
  let drives;
  let mayStop;
  let refused;
  let take;
  let end;

  const press = (type, code, target = document.body, extra = {}) => {
    const event = new KeyboardEvent(type, { code, bubbles: true, cancelable: true, ...extra });
    target.dispatchEvent(event);
    return event;
  };

  beforeEach(() => {
    stick = new Stick();
    stop = vi.fn();
    drives = true;
    mayStop = true;
    refused = vi.fn();
    take = vi.fn();
    const host = { holonomic: () => false, drives: () => drives, mayStop: () => mayStop };
    end = listenToKeys({ stick, stop, refused, take, ...host });
  });

  afterEach(() => {
    end();
    document.body.replaceChildren();
  });

  it("takes control by T, once, but not while a person writes or another view uses the key", () => {
    const field = document.body.appendChild(document.createElement("input"));
    const scene = document.body.appendChild(document.createElement("canvas"));
    scene.addEventListener("keydown", (event) => event.preventDefault());
    press("keydown", "KeyT", field);
    press("keydown", "KeyT", scene);
    press("keydown", "KeyT", document.body, { ctrlKey: true });
    press("keydown", "KeyT", document.body, { repeat: true });
    expect(take).not.toHaveBeenCalled();
    press("keydown", "KeyT");
    expect(take).toHaveBeenCalledTimes(1);
  });

  it("drives while a key is held", () => {
    press("keydown", "KeyW");
    expect(stick.axes.x).toBe(1);
    press("keyup", "KeyW");
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("does nothing without control: space is a space", () => {
    drives = false;
    mayStop = false;
    press("keydown", "KeyW");
    const space = press("keydown", "Space");
    expect(stick.axes).toEqual(NEUTRAL);
    expect(refused).toHaveBeenCalledOnce(); // the page says why nothing moves
    expect(stop).not.toHaveBeenCalled();
    expect(space.defaultPrevented).toBe(false);
  });

  it("stops but does not drive while the connection is lost", () => {
    drives = false;
    press("keydown", "KeyW");
    expect(press("keydown", "Space").defaultPrevented).toBe(true);
    expect(stop).toHaveBeenCalledTimes(1);
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("stops by space, once per press", () => {
    press("keydown", "Space");
    press("keydown", "Space", document.body, { repeat: true });
    expect(stop).toHaveBeenCalledTimes(1);
  });

  it("does nothing in fields and open dialogs", () => {
    const field = document.body.appendChild(document.createElement("textarea"));
    press("keydown", "KeyW", field);
    press("keydown", "Space", field);
    expect(stick.axes).toEqual(NEUTRAL);
    expect(stop).not.toHaveBeenCalled();
  });

  it("stops by space on a dialog's button, which Enter presses, but not in its field", () => {
    document.body.innerHTML = "<dialog open><button></button><input></dialog>";
    const [button, field] = document.querySelectorAll("button, input");
    press("keydown", "KeyW", button);
    press("keydown", "Space", field);
    expect([stick.axes, stop.mock.calls.length]).toEqual([NEUTRAL, 0]);
    for (const type of ["keydown", "keyup"])
      expect(press(type, "Space", button).defaultPrevented).toBe(true);
    expect(stop).toHaveBeenCalledOnce();
  });

  it("leaves the browser's own shortcuts alone", () => {
    press("keydown", "KeyW", document.body, { ctrlKey: true });
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("forgets held keys when the window loses the focus", () => {
    press("keydown", "KeyW");
    window.dispatchEvent(new Event("blur"));
    expect(stick.axes).toEqual(NEUTRAL);
  });

  it("does nothing after close", () => {
    end();
    press("keydown", "KeyW");
    expect(stick.axes).toEqual(NEUTRAL);
  });
});
