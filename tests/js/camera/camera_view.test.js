import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { CameraView, fileName, pictureText } from "../../../static/js/camera/camera_view.js";
import { headerOf } from "./frames.js";
import { cameraElement } from "./page.js";

describe("the words of a picture", () => {
  it("says its age only when that matters", () => {
    expect(pictureText(300)).toBe("");
    expect(pictureText(320)).toBe("picture 0.3 s old");
    expect(pictureText(1290)).toBe("picture 1 s old");
    expect(pictureText(185_000)).toBe("picture 3 min old");
  });

  it("names a file by robot, camera and time", () => {
    const date = new Date(2026, 10, 4, 9, 5, 7);
    expect(fileName("tiago-1", "head", date, "image/jpeg")).toBe(
      "tiago-1-head-2026-11-04-09-05-07.jpg",
    );
    expect(fileName("a", "b", date, "image/png")).toMatch(/\.png$/);
  });
});

describe("a camera on the page", () => {
  let element;
  let view;
  let nowMs;
  const of = (name) => element.querySelector(name);
  const settle = () => new Promise((resolve) => setTimeout(resolve));
  const take = async (number, ageMs) => {
    view.take({ header: headerOf(number), bytes: new Uint8Array(1), takenMs: nowMs - ageMs });
    await settle();
  };

  beforeEach(() => {
    nowMs = 10_000;
    vi.spyOn(performance, "now").mockImplementation(() => nowMs);
    vi.stubGlobal("createImageBitmap", async () => ({ width: 4, height: 3, close() {} }));
    element = cameraElement();
    view = new CameraView(element);
    view.camera = { name: "head", label: "Head camera", moves: true };
  });

  afterEach(() => {
    view.close();
    vi.restoreAllMocks();
    vi.unstubAllGlobals();
  });

  it("waits for its first picture, in words", async () => {
    expect(of(".camera-words").textContent).toBe("Waiting for the first picture.");
    expect(of("canvas").getAttribute("aria-label")).toBe("Head camera");
    await take(1, 40);
    expect(of(".camera-words").hidden).toBe(true);
    expect(view.header.number).toBe(1);
  });

  it("tells the scale of a depth picture", async () => {
    const header = { ...headerOf(1), scale: { low: 0.4, high: 3.2, unit: "m" } };
    view.take({ header, bytes: new Uint8Array(1), takenMs: nowMs });
    await settle();
    expect(of("canvas").getAttribute("aria-label")).toBe("Head camera, 0.4 to 3.2 m");
    await take(2, 40);
    expect(of("canvas").getAttribute("aria-label")).toBe("Head camera");
  });

  it("turns grey and counts on while no picture comes", async () => {
    await take(1, 40);
    expect([element.dataset.old, of(".camera-age").hidden]).toEqual([undefined, true]);
    nowMs += 400;
    view.update();
    expect([element.dataset.old, of(".camera-age").textContent]).toEqual([
      undefined,
      "picture 0.4 s old",
    ]);
    nowMs += 1000;
    view.update();
    expect([element.dataset.old, of(".camera-age").textContent]).toEqual([
      "true",
      "picture 1 s old",
    ]);
    await take(2, 10);
    expect([element.dataset.old, of(".camera-age").hidden]).toEqual([undefined, true]);
  });

  it("says why there are no pictures, until one comes", async () => {
    view.why = "The camera is silent.";
    expect(of(".camera-words").textContent).toBe("The camera is silent.");
    await take(1, 10);
    expect(of(".camera-words").hidden).toBe(true);
  });

  it("says that a picture is damaged, until a sound one comes", async () => {
    vi.stubGlobal("createImageBitmap", async () => {
      throw new Error("broken");
    });
    await take(1, 10);
    expect(of(".camera-words").textContent).toBe("The picture came damaged.");
    vi.stubGlobal("createImageBitmap", async () => ({ width: 4, height: 3, close() {} }));
    await take(2, 10);
    expect(of(".camera-words").hidden).toBe(true);
  });

  it("keeps its picture over a new connection, not another camera", async () => {
    await take(9, 10);
    view.again();
    await take(1, 10);
    expect(view.header.number).toBe(1);
    view.camera = { name: "wrist", label: "Wrist camera" };
    expect(view.header).toBe(null);
  });
});
