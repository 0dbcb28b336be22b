import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { corners, whole } from "../../../static/js/navigation/map_frame.js";
import { MapView } from "../../../static/js/navigation/map_view.js";
import { point } from "../hand/events.js";

const SIZE = [400, 300];
const HALL = { width: 200, height: 160, resolution_m: 0.05, origin_x_m: -2, origin_y_m: -2 };
const MAP = { ...HALL, origin_rad: 0 };
const PEN = new Proxy({}, { get: () => () => {}, set: () => true });

describe("the map under fingers, wheel and keys", () => {
  let canvas;
  let view;

  beforeEach(() => {
    vi.stubGlobal(
      "ResizeObserver",
      class {
        observe() {}
        disconnect() {}
      },
    );
    vi.stubGlobal("requestAnimationFrame", () => 1);
    HTMLCanvasElement.prototype.getContext = () => PEN;
    canvas = document.createElement("canvas");
    const [width, height] = SIZE;
    Object.defineProperties(canvas, {
      clientWidth: { value: width },
      clientHeight: { value: height },
    });
    document.body.replaceChildren(canvas);
    view = new MapView(canvas);
    view.show(MAP, null);
  });

  afterEach(() => {
    view.close();
    vi.unstubAllGlobals();
  });

  function send(type, clientX, clientY, more = {}) {
    point(canvas, type, { clientX, clientY, ...more });
  }

  function press(...keys) {
    for (const key of keys) canvas.dispatchEvent(new KeyboardEvent("keydown", { key }));
  }

  /** Return the place of the map that a press at this pixel chooses. */
  function at(x, y) {
    let found;
    view.addEventListener(
      "choose",
      ({ detail }) => {
        found = [detail.x, detail.y];
      },
      { once: true },
    );
    view.chooses = true;
    send("pointerdown", x, y);
    send("pointerup", x, y);
    view.chooses = false;
    return found;
  }

  /** Return the pixels per metre. */
  function scale() {
    return 100 / (at(200, 150)[0] - at(100, 150)[0]);
  }

  function expectPlace([x, y], [wantedX, wantedY]) {
    expect(x).toBeCloseTo(wantedX);
    expect(y).toBeCloseTo(wantedY);
  }

  it("is zoomed by the wheel, round the place under the mouse", () => {
    const [place, before] = [at(90, 80), scale()];
    send("wheel", 90, 80, { deltaY: -400 });
    expectPlace(at(90, 80), place);
    expect(scale()).toBeGreaterThan(1.5 * before);
  });

  it("is zoomed and moved by two fingers, and chooses nothing meanwhile", () => {
    const picked = vi.fn();
    view.addEventListener("pick", picked);
    const [left, right, before] = [at(150, 150), at(250, 150), scale()];
    send("pointerdown", 150, 150);
    send("pointerdown", 250, 150, { pointerId: 2 });
    send("pointermove", 100, 150);
    send("pointermove", 300, 150, { pointerId: 2 });
    for (const pointerId of [1, 2]) send("pointerup", 200, 150, { pointerId });
    expect(scale()).toBeCloseTo(2 * before);
    expectPlace(at(100, 150), left);
    expectPlace(at(300, 150), right);
    send("click", 200, 150);
    expect(picked).not.toHaveBeenCalled();
  });

  it("moves under one finger", () => {
    const place = at(200, 150);
    send("pointerdown", 200, 150);
    send("pointermove", 260, 110);
    send("pointerup", 260, 110);
    expectPlace(at(260, 110), place);
  });

  it("obeys + - 0 and the arrows", () => {
    const begin = whole(corners(MAP), ...SIZE).scale;
    const middle = at(200, 150);
    press("+", "+");
    expect(scale()).toBeCloseTo(1.96 * begin);
    expectPlace(at(200, 150), middle);
    press("-");
    expect(scale()).toBeCloseTo(1.4 * begin);
    press("ArrowRight", "ArrowUp");
    expectPlace(at(140, 210), middle);
    press("0");
    expect(scale()).toBeCloseTo(begin);
    expectPlace(at(200, 150), middle);
  });

  it("never zooms in by a step outwards, also on a map of 300 m", () => {
    view.show({ ...MAP, width: 6000, height: 4000 }, null);
    const begin = scale();
    expect(begin).toBeLessThan(2);
    press("-");
    send("wheel", 90, 80, { deltaY: 400 });
    expect(scale()).toBeCloseTo(begin);
  });
});
