import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { CameraPanel } from "../../../static/js/camera/camera_panel.js";
import { parts } from "../../../static/js/lib/dom.js";
import * as prefs from "../../../static/js/lib/prefs.js";
import { FakeSocket, made } from "../fake_socket.js";
import { headerOf, packed } from "./frames.js";
import { areaElement } from "./page.js";

const HEAD = { name: "head", label: "Head camera", moves: true };
const BARE = { slug: "tiago-1", footprint: [[0.3, 0]], cameras: [] };
const FACTS = { ...BARE, cameras: [HEAD] };
const SILENT = { code: "silent", text: "The camera is silent." };

describe("the cameras of the control page", () => {
  let found;
  let panel;
  let page;
  const settle = () => vi.advanceTimersByTimeAsync(0);
  const says = (message) => made.at(-1).says(JSON.stringify(message));
  const sent = () => made.at(-1).sent.filter(({ t }) => t !== "ping");
  const reported = () => page.send.mock.calls.map(([{ age_ms: age }]) => age);
  const picture = async (number) => {
    says({ t: "camera_pong", sent_ms: performance.now(), now_ms: performance.now() });
    made.at(-1).says(packed(headerOf(number, { taken_ms: performance.now() - 100 })));
    await settle();
  };

  beforeEach(() => {
    vi.useFakeTimers();
    FakeSocket.begin();
    vi.stubGlobal("WebSocket", FakeSocket);
    vi.stubGlobal("createImageBitmap", async () => ({ width: 4, height: 3, close() {} }));
    vi.stubGlobal(
      "ResizeObserver",
      class {
        observe() {}
        disconnect() {}
      },
    );
    vi.stubGlobal("requestAnimationFrame", () => 1);
    for (const name of ["camera-view", "camera-main", "camera-second"]) prefs.remember(name, null);
    begin({ hasCameras: true });
    made[0].opens();
  });

  const begin = ({ hasCameras }) => {
    const root = areaElement();
    if (hasCameras) root.dataset.hasCameras = "true";
    found = parts(root);
    page = { request: vi.fn(async () => null), send: vi.fn(), notify: vi.fn(), tell: vi.fn() };
    panel = new CameraPanel({ root, parts: found, ...page });
  };
  const beginAnew = (given) => {
    panel.close();
    FakeSocket.begin();
    begin(given);
  };

  afterEach(() => {
    panel.close();
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  const press = (view) => found.views.querySelector(`[data-view=${view}]`).click();

  it("watches the camera of a robot that has one", async () => {
    expect(made[0].url).toContain("/ws/robots/tiago-1/camera/");
    expect(sent()).toEqual([]);
    says({ t: "cameras", cameras: [HEAD] });
    expect(sent()).toMatchObject([{ t: "camera_watch", camera: "head", size: "full" }]);
    await picture(1);
    expect(sent().at(-1)).toEqual({ t: "camera_ack", camera: "head", number: 1 });
  });

  it("closes the connection while no camera is shown", () => {
    says({ t: "cameras", cameras: [HEAD] });
    press("plan");
    expect(sent().at(-1)).toEqual({ t: "camera_end", camera: "head" });
    expect(made[0].readyState).toBe(3);
    vi.advanceTimersByTime(10_000);
    expect(made).toHaveLength(1);
    press("camera");
    made[1].opens();
    expect(sent()).toMatchObject([{ t: "camera_watch", camera: "head" }]);
  });

  it("opens no connection to a robot without a camera, until it gets one", () => {
    beginAnew({ hasCameras: false });
    panel.facts = BARE;
    expect(made).toHaveLength(0);
    panel.facts = FACTS; // somebody has added a camera
    made[0].opens();
    expect(sent()).toMatchObject([{ t: "camera_watch", camera: "head" }]);
    panel.facts = BARE;
    expect(made[0].readyState).toBe(3);
    vi.advanceTimersByTime(10_000);
    expect(made).toHaveLength(1);
  });

  it("opens no connection at once for a person who chose the plan", () => {
    prefs.remember("camera-view", "plan");
    beginAnew({ hasCameras: true });
    panel.facts = FACTS;
    expect(made).toHaveLength(0);
  });

  it.each([4401, 4403, 4404])("does not connect again after a close with %s", (code) => {
    says({ t: "cameras", cameras: [HEAD] });
    made[0].close(code);
    panel.facts = FACTS;
    press("plan");
    press("camera");
    vi.advanceTimersByTime(10_000);
    expect(made).toHaveLength(1);
  });

  it("says that no more pictures come after a close for good", () => {
    says({ t: "cameras", cameras: [HEAD] });
    made[0].close(4403);
    const words = found.camera.querySelector(".camera-words").textContent;
    expect(words).toContain("No more pictures");
  });

  it("says why there are no pictures", async () => {
    says({ t: "cameras", cameras: [HEAD] });
    const words = () => found.camera.querySelector(".camera-words").textContent;
    says({ t: "camera_state", camera: "head", refusal: SILENT });
    expect(words()).toBe("The camera is silent.");
    says({ t: "camera_state", camera: "head", refusal: null });
    expect(words()).toBe("Waiting for the first picture.");
    made[0].close(1006);
    expect(words()).toContain("No connection for pictures.");
  });

  it("tells why nothing is drawn into the pictures", () => {
    says({ t: "cameras", cameras: [HEAD] });
    const warning = { code: "bad_camera_info", text: "The camera info does not fit." };
    says({ t: "camera_state", camera: "head", warning });
    const { text } = warning;
    const notice = { level: "warning", code: "camera bad_camera_info", text, short: text };
    expect(page.notify).toHaveBeenCalledWith(notice);
  });

  it("reports the age of the picture to the console while driving", async () => {
    says({ t: "cameras", cameras: [HEAD] });
    await picture(1);
    vi.advanceTimersByTime(1000);
    expect(reported()).toEqual([]);
    panel.mayAct = true;
    vi.advanceTimersByTime(1000);
    expect(reported()).toHaveLength(5);
    expect(reported()[0]).toBeGreaterThanOrEqual(1100);
    expect(reported().at(-1) - reported()[0]).toBeCloseTo(800);
    press("plan");
    vi.advanceTimersByTime(1000);
    expect(reported().slice(5)).toEqual([null]);
    press("camera");
    made[1].opens();
    await picture(2);
    vi.advanceTimersByTime(100);
    panel.mayAct = false;
    vi.advanceTimersByTime(1000);
    expect(reported().slice(6)).toEqual([expect.any(Number), null]);
  });

  it("still reports the picture that somebody sees when the console says that no more come", async () => {
    says({ t: "cameras", cameras: [HEAD] });
    panel.mayAct = true;
    await picture(1);
    says({ t: "camera_state", camera: "head", refusal: SILENT });
    vi.advanceTimersByTime(1000);
    expect(reported().at(-1)).toBeGreaterThan(900);
  });

  it("reports no picture that is gone while the plan is beside it", async () => {
    says({ t: "cameras", cameras: [HEAD] });
    expect(found["picture-area"].dataset.view).toBe("both");
    panel.mayAct = true;
    await picture(1);
    vi.advanceTimersByTime(4000);
    expect(reported().at(-1)).toBe(null);
    press("camera");
    vi.advanceTimersByTime(300);
    expect(reported().at(-1)).toBeGreaterThan(4000);
  });

  it("turns the head by the picture of a camera that moves", async () => {
    says({ t: "cameras", cameras: [HEAD] });
    panel.mayAct = true;
    await picture(1);
    expect(found["camera-floor"].dataset.turns).toBe("true");
    found["head-keys"].querySelector("button").click();
    expect(page.request).toHaveBeenCalledWith({ t: "turn_head", pan: 0.15, tilt: 0, quiet: true });
    says({ t: "cameras", cameras: [{ ...HEAD, moves: false }] });
    expect(found["camera-floor"].dataset.turns).toBe(undefined);
    expect(found["head-keys"].hidden).toBe(true);
  });

  it("tells what was refused as a notice", () => {
    says({ t: "refused", of: "camera_watch", refusal: { code: "not_permitted", text: "No." } });
    expect(page.notify).toHaveBeenCalledWith({
      level: "warning",
      code: "camera not_permitted",
      text: "No.",
      short: "No.",
    });
  });
});
