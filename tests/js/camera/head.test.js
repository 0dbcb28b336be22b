import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Head, turnByDrag, turnToPoint } from "../../../static/js/camera/head.js";
import { point as send } from "../hand/events.js";
import { headerOf } from "./frames.js";

const LENS = [500, 500, 320, 240];

describe("the turn of the head", () => {
  const header = headerOf(1, { lens: LENS });

  it("follows a finger: to the right looks left, down looks up", () => {
    expect(turnByDrag(50, 25, header)).toEqual({ pan: Math.atan(0.1), tilt: Math.atan(0.05) });
  });

  it("brings a place into the middle", () => {
    expect(turnToPoint(420, 340, header)).toEqual({ pan: Math.atan(-0.2), tilt: Math.atan(-0.2) });
    expect(turnToPoint(320, 240, header)).toEqual({ pan: 0, tilt: 0 });
  });

  it("brings a place beside the way into the middle while the head looks down", () => {
    // The camera looks 39 degrees down. In the base frame its axis is (cos, 0, -sin), its right is (0, -1, 0), and its
    // down is (-sin, 0, -cos).
    const [c, s] = [Math.cos(0.68), Math.sin(0.68)];
    const pose = [0, -1, 0, 0, -s, 0, -c, 0, c, 0, -s, 0];
    const { pan, tilt } = turnToPoint(620, 240, { ...header, pose });
    // The place is at (c, -0.6, -s): at the new heading and elevation it is straight ahead.
    expect(pan).toBeCloseTo(Math.atan2(-0.6, c), 6);
    expect(-0.68 + tilt).toBeCloseTo(Math.atan2(-s, Math.hypot(c, 0.6)), 6);
    const still = turnToPoint(320, 240, { ...header, pose });
    expect([still.pan, still.tilt]).toEqual([expect.closeTo(0), expect.closeTo(0)]);
  });

  it("takes a common lens where the camera tells none", () => {
    expect(turnByDrag(64, 0, headerOf(1)).pan).toBeCloseTo(Math.atan(0.1));
  });
});

describe("the picture as a handle of the head", () => {
  let area;
  let keys;
  let requests;
  let refused;
  let request;
  let head;
  let pose;
  let pointed; // pixels of clicks
  let isFloor;

  beforeEach(() => {
    vi.useFakeTimers();
    area = document.body.appendChild(document.createElement("canvas"));
    // A picture of 640 x 480 pixels in half its size, with bars of 40 pixels at its sides.
    area.getBoundingClientRect = () => ({ left: 10, top: 20, width: 400, height: 240 });
    keys = document.body.appendChild(document.createElement("div"));
    for (const turn of ["left", "up", "ahead"]) {
      const key = keys.appendChild(document.createElement("button"));
      key.dataset.turn = turn;
    }
    requests = [];
    pose = null;
    pointed = [];
    isFloor = false;
    refused = null;
    request = async () => refused;
    head = new Head(area, keys, {
      request: (given) => {
        requests.push(given);
        return request();
      },
      header: () => headerOf(1, { lens: LENS, pose }),
      point: (pixel) => {
        pointed.push(pixel);
        return isFloor;
      },
    });
    head.moves = true;
    head.mayAct = true;
    vi.advanceTimersByTime(1000);
  });

  afterEach(() => {
    head.close();
    document.body.replaceChildren();
    vi.useRealTimers();
  });

  const point = (type, clientX, clientY, pointerId = 1, facts = {}) =>
    send(area, type, { clientX, clientY, pointerId, ...facts });
  const click = (x, y) => {
    point("pointerdown", x, y);
    point("pointerup", x, y);
  };

  it("drags: at most five requests a second, and none is lost", async () => {
    point("pointerdown", 200, 100);
    for (let i = 1; i <= 20; i += 1) {
      point("pointermove", 200 + 5 * i, 100);
      await vi.advanceTimersByTimeAsync(50);
    }
    point("pointerup", 300, 100);
    await vi.advanceTimersByTimeAsync(1000);
    expect(requests.length).toBeGreaterThan(3);
    expect(requests.length).toBeLessThanOrEqual(6);
    expect(requests.every(({ t, quiet }) => t === "turn_head" && quiet)).toBe(true);
    const pan = requests.reduce((sum, request) => sum + request.pan, 0);
    expect(pan).toBeCloseTo(160 / 500, 2); // 100 pixels of the page are 160 pixels of the picture
    expect(requests.every(({ tilt }) => tilt === 0)).toBe(true);
  });

  it("queues no more than two requests on a stalled network, and sends the rest after an answer", async () => {
    const answers = [];
    request = () => new Promise((resolve) => answers.push(resolve));
    point("pointerdown", 200, 100);
    for (let i = 1; i <= 20; i += 1) {
      point("pointermove", 200 + 5 * i, 100);
      await vi.advanceTimersByTimeAsync(200);
    }
    expect(requests).toHaveLength(2);
    answers[0](null);
    await vi.advanceTimersByTimeAsync(200);
    expect(requests).toHaveLength(3);
    expect(requests.reduce((sum, { pan }) => sum + pan, 0)).toBeCloseTo(160 / 500, 2);
    for (const answer of answers.slice(1)) {
      point("pointermove", 320, 100);
      answer({ code: "no_answer", text: "No answer within 0.75 s." }); // the request may still wait in the network
      await vi.advanceTimersByTimeAsync(200);
    }
    point("pointermove", 340, 100);
    await vi.advanceTimersByTimeAsync(200);
    expect(requests).toHaveLength(3);
    point("pointerup", 340, 100);
    point("pointerdown", 200, 100);
    point("pointermove", 250, 100);
    await vi.advanceTimersByTimeAsync(200);
    expect(requests).toHaveLength(4);
  });

  it("looks at a clicked place, once no second click comes", () => {
    click(10 + 420 * 0.625, 20 - 60 + 340 * 0.625); // u 420, v 340
    vi.advanceTimersByTime(250);
    expect(requests).toEqual([]);
    vi.advanceTimersByTime(100);
    expect(requests).toEqual([
      { t: "turn_head", pan: Math.atan(-0.2), tilt: Math.atan(-0.2), quiet: true },
    ]);
  });

  it("looks ahead after a double click, and nowhere else", () => {
    click(100, 100);
    click(101, 100);
    vi.advanceTimersByTime(1000);
    expect(requests).toEqual([{ t: "look_ahead", quiet: true }]);
  });

  it("only points at a clicked place of the floor near the robot", () => {
    isFloor = true;
    click(10 + 420 * 0.625, 20 - 60 + 340 * 0.625);
    vi.advanceTimersByTime(1000);
    expect([pointed, requests]).toEqual([[[420, 340]], []]);
    click(100, 100);
    click(101, 100);
    expect(pointed.at(-1)).toBe(null); // the person meant to look ahead
    expect(requests).toEqual([{ t: "look_ahead", quiet: true }]);
  });

  it("points without control, too", () => {
    head.mayAct = false;
    point("click", 210, 140);
    expect(pointed).toEqual([[320, 288]]);
  });

  it("looks at a point of the floor, also one that the picture does not show", () => {
    pose = [0, -1, 0, 0, 0, 0, -1, 1, 1, 0, 0, 0]; // 1 m high, straight ahead
    head.lookAt([0, 1]);
    expect(requests[0]).toMatchObject({
      t: "turn_head",
      pan: expect.closeTo(Math.PI / 2),
      tilt: expect.closeTo(-Math.PI / 4),
    });
  });

  it("follows one finger only", () => {
    point("pointerdown", 200, 100, 1);
    point("pointerdown", 100, 100, 2);
    point("pointermove", 150, 100, 2);
    point("pointerup", 150, 100, 2);
    vi.advanceTimersByTime(1000);
    expect(requests).toEqual([]);
    point("pointermove", 250, 100, 1);
    vi.advanceTimersByTime(1000);
    expect(requests).toHaveLength(1);
  });

  it("ends a drag that is refused", async () => {
    refused = { code: "no_head", text: "The head does not move." };
    point("pointerdown", 200, 100);
    point("pointermove", 250, 100);
    await vi.advanceTimersByTimeAsync(0);
    point("pointermove", 300, 100);
    await vi.advanceTimersByTimeAsync(1000);
    expect(requests).toHaveLength(1);
  });

  it("goes on when only the answer is late", async () => {
    refused = { code: "no_answer", text: "No answer within 0.75 s." };
    point("pointerdown", 200, 100);
    point("pointermove", 250, 100);
    await vi.advanceTimersByTimeAsync(0);
    point("pointermove", 300, 100);
    await vi.advanceTimersByTimeAsync(1000);
    expect(requests).toHaveLength(2);
  });

  it.each(["moves", "mayAct"])("does nothing without %s", (name) => {
    head[name] = false;
    expect(area.dataset.turns).toBe(undefined);
    click(100, 100);
    point("pointerdown", 200, 100);
    point("pointermove", 250, 100);
    vi.advanceTimersByTime(1000);
    expect(requests).toEqual([]);
  });

  it("turns by buttons, too", () => {
    for (const key of keys.children) key.click();
    expect(requests).toEqual([
      { t: "turn_head", pan: 0.15, tilt: 0, quiet: true },
      { t: "turn_head", pan: 0, tilt: 0.15, quiet: true },
      { t: "look_ahead", quiet: true },
    ]);
    head.mayAct = false;
    expect(keys.firstChild.getAttribute("aria-disabled")).toBe("true");
    head.moves = false;
    expect(keys.hidden).toBe(true);
  });
});
