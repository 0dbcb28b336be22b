import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Thumbnails } from "../../../static/js/fleet/thumbnails.js";
import { headerOf, packed } from "../camera/frames.js";
import { FakeSocket, made } from "../fake_socket.js";

const CAMERAS = { t: "cameras", cameras: [{ name: "head", label: "Head", moves: true }] };

describe("thumbnails of cameras", () => {
  let thumbnails;
  let canvas;
  let painted;

  beforeEach(() => {
    FakeSocket.begin();
    vi.stubGlobal("WebSocket", FakeSocket);
    vi.stubGlobal("createImageBitmap", async () => ({ width: 320, height: 240, close() {} }));
    canvas = document.createElement("canvas");
    canvas.dataset.thumbnail = "tiago-1";
    canvas.hidden = true;
    painted = [];
    canvas.getContext = () => ({
      drawImage: (source) => painted.push(source),
      clearRect: () => painted.splice(0),
    });
    document.body.replaceChildren(canvas);
    thumbnails = new Thumbnails(document);
    made[0].opens();
  });

  afterEach(() => {
    thumbnails.close();
    vi.unstubAllGlobals();
  });

  const hears = (message) => made[0].says(JSON.stringify(message));
  const sent = (t) => made[0].sent.filter((message) => message.t === t);

  it("watch the first camera, small and slowly", () => {
    hears(CAMERAS);
    expect(sent("camera_watch")).toEqual([
      { t: "camera_watch", camera: "head", video: false, rate_hz: 0.2, size: "small" },
    ]);
  });

  it("show a picture, and none while the camera has none", async () => {
    hears(CAMERAS);
    made[0].says(packed(headerOf(1)));
    expect(canvas.hidden).toBe(false); // from now on the picture has its place
    await vi.waitFor(() => expect(painted).toHaveLength(1));
    expect(sent("camera_ack")).toEqual([{ t: "camera_ack", camera: "head", number: 1 }]);
    hears({
      t: "camera_state",
      camera: "head",
      refusal: { code: "no_publisher", text: "off" },
    });
    expect(painted).toEqual([]);
    expect(canvas.hidden).toBe(false);
  });

  it("leave a robot without a camera alone", () => {
    hears({ t: "cameras", cameras: [] });
    expect(sent("camera_watch")).toEqual([]);
    expect(made[0].readyState).toBe(3);
  });
});
