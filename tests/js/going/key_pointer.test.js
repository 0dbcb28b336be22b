import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { KeyPointer } from "../../../static/js/going/key_pointer.js";
import { HeldKeys } from "../../../static/js/hand/held_keys.js";

describe("pointing by keys", () => {
  let picture;
  let words;
  let pointer;
  let keys;
  const choose = vi.fn();
  const drives = vi.fn();
  const stops = vi.fn();

  beforeEach(() => {
    document.body.innerHTML = "<canvas></canvas><p></p>";
    [picture, words] = document.body.children;
    for (const [side, pixels] of [
      ["clientWidth", 400],
      ["clientHeight", 200],
    ])
      Object.defineProperty(picture, side, { value: pixels });
    // 100 pixels are a metre; the robot stands in the middle of the lower edge, and there is no floor in the upper half.
    pointer = new KeyPointer(picture, words, {
      begins: [0.5, 0.75],
      pointAt: ([right, down]) => (down < 100 ? null : [(200 - down) / 100, (200 - right) / 100]),
      choose,
    });
    keys = new HeldKeys(window, ["KeyW", "ArrowUp"], () => true, drives);
    window.addEventListener("keydown", stops);
    picture.focus();
  });

  afterEach(() => {
    window.removeEventListener("keydown", stops);
    pointer.close();
    keys.close();
    vi.clearAllMocks();
  });

  const press = (key, code = key, facts = {}) => {
    const event = { key, code, bubbles: true, cancelable: true, ...facts };
    picture.dispatchEvent(new KeyboardEvent("keydown", event));
  };
  const cross = () => document.querySelector(".key-cross");

  it("begins by Enter, not by the focus: before, the keys drive", () => {
    press("w", "KeyW");
    expect([...drives.mock.lastCall[0]]).toEqual(["KeyW"]);
    press("Enter");
    expect(drives.mock.lastCall[0].size).toBe(0); // the held key ended
    drives.mockClear();
    for (const [key, code] of [
      ["w", "KeyW"],
      ["ArrowUp", "ArrowUp"],
    ])
      press(key, code);
    expect(drives).not.toHaveBeenCalled();
    stops.mockClear();
    press(" ", "Space");
    expect(stops).toHaveBeenCalledOnce(); // the page hears it, and stops
  });

  it("moves a cross, says where it is, and chooses", () => {
    press("Enter");
    expect(words.textContent).toBe("0.5 m ahead, 0.0 m to the left");
    press("ArrowUp");
    press("ArrowRight");
    press("ArrowRight");
    expect(words.textContent).toBe("0.6 m ahead, 0.1 m to the right");
    expect(cross().hidden).toBe(false);
    press("Enter", "Enter", { repeat: true });
    expect(choose).not.toHaveBeenCalled();
    press("Enter");
    expect(choose).toHaveBeenCalledExactlyOnceWith([expect.closeTo(0.55), expect.closeTo(-0.1)]);
    expect(cross().hidden).toBe(true);
  });

  it("stays on the floor near the robot", () => {
    press("Enter");
    for (let step = 0; step < 30; step += 1) press("ArrowUp");
    expect(words.textContent).toBe("1.0 m ahead, 0.0 m to the left");
  });

  it.each(["Escape", "blur"])("ends with %s", (way) => {
    press("Enter");
    if (way === "blur") picture.blur();
    else press(way);
    expect(cross().hidden).toBe(true);
    press("w", "KeyW");
    expect([...drives.mock.lastCall[0]]).toEqual(["KeyW"]);
  });
});
