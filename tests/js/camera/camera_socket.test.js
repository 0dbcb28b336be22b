import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { CameraSocket } from "../../../static/js/camera/camera_socket.js";
import { FakeSocket, made } from "../fake_socket.js";
import { headerOf, packed } from "./frames.js";

const WATCH = { t: "camera_watch", camera: "head", video: false, rate_hz: 30, size: "full" };

describe("the connection of the cameras", () => {
  let socket;
  let heard;
  let video;
  const sent = () => made.at(-1).sent.filter(({ t }) => t !== "ping");
  const settle = () => vi.advanceTimersByTimeAsync(0);

  beforeEach(() => {
    vi.useFakeTimers();
    FakeSocket.begin();
    vi.stubGlobal("WebSocket", FakeSocket);
    socket = new CameraSocket("ws://here/", new Promise((resolve) => (video = resolve)));
    heard = [];
    for (const type of ["open", "down", "cameras", "picture", "state"])
      socket.addEventListener(type, ({ detail }) => heard.push([type, detail]));
  });

  afterEach(() => {
    socket.close();
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  const opened = () => {
    socket.open();
    made.at(-1).opens();
  };

  it("connects only when it is opened, and pings at once", () => {
    expect(made).toHaveLength(0);
    opened();
    expect(made[0].sent).toEqual([{ t: "ping", sent_ms: expect.any(Number) }]);
  });

  it("watches again after a loss, and ends what is put away", () => {
    socket.watch("head", "full");
    opened();
    expect(sent()).toEqual([WATCH]);
    socket.watch("head", "full");
    socket.watch("head", "small");
    expect(sent().slice(1)).toEqual([{ ...WATCH, size: "small" }]);
    made[0].close(1006);
    vi.advanceTimersByTime(250);
    made[1].opens();
    expect(sent()).toEqual([{ ...WATCH, size: "small" }]);
    socket.end("head");
    socket.end("head");
    expect(sent().slice(1)).toEqual([{ t: "camera_end", camera: "head" }]);
  });

  it("asks for video once the browser is known to decode it", async () => {
    opened();
    socket.watch("head", "full");
    video(true);
    await settle();
    expect(sent()).toEqual([WATCH, { ...WATCH, video: true }]);
  });

  it("watches nothing while the page is hidden", () => {
    opened();
    socket.watch("head", "full");
    const hidden = vi.spyOn(document, "hidden", "get").mockReturnValue(true);
    document.dispatchEvent(new Event("visibilitychange"));
    socket.watch("wrist", "full");
    hidden.mockReturnValue(false);
    document.dispatchEvent(new Event("visibilitychange"));
    expect(sent().slice(1)).toEqual([
      { t: "camera_end", camera: "head" },
      WATCH,
      { ...WATCH, camera: "wrist" },
    ]);
  });

  it("hands over pictures, with their time by this page's clock", () => {
    opened();
    socket.watch("head", "full");
    const nowMs = performance.now();
    made[0].says(JSON.stringify({ t: "camera_pong", sent_ms: nowMs - 20, now_ms: 5000 }));
    made[0].says(packed(headerOf(7, { taken_ms: 4960 }), [9]));
    const [type, { header, bytes, takenMs }] = heard.at(-1);
    expect([type, header.number, [...bytes]]).toEqual(["picture", 7, [9]]);
    expect(takenMs).toBeCloseTo(nowMs - 50); // the console's clock showed 5000 at this page's nowMs - 10
  });

  it("believes the clock of the shortest round trip", () => {
    opened();
    socket.watch("head", "full");
    const nowMs = performance.now();
    const pong = (tripMs, consoleMs) =>
      made[0].says(
        JSON.stringify({ t: "camera_pong", sent_ms: nowMs - tripMs, now_ms: consoleMs }),
      );
    pong(10, 1005);
    pong(400, 1150); // most of these 400 ms passed on the way back
    made[0].says(packed(headerOf(1, { taken_ms: 1000 })));
    expect(heard.at(-1)[1].takenMs).toBeCloseTo(nowMs - 10);
  });

  it.each([
    [new ArrayBuffer(0)],
    [new Uint8Array([0, 0, 0, 9, 1]).buffer],
    [new Uint8Array([0, 0, 0, 1, 123]).buffer],
    [packed(headerOf(1, { camera: "wrist" }))],
  ])("ignores what is no picture of a watched camera", (frame) => {
    opened();
    socket.watch("head", "full");
    made[0].says(frame);
    expect(heard.filter(([type]) => type === "picture")).toEqual([]);
  });

  it("acknowledges pictures by camera and number", () => {
    opened();
    socket.acknowledge(headerOf(3), false);
    socket.acknowledge(headerOf(4), true);
    expect(sent()).toEqual([
      { t: "camera_ack", camera: "head", number: 3 },
      { t: "camera_ack", camera: "head", number: 4, damaged: true },
    ]);
  });

  it("reports why there are no pictures", () => {
    opened();
    const refusal = { code: "silent", text: "The camera is silent." };
    made[0].says(JSON.stringify({ t: "cameras", cameras: [{ name: "head" }] }));
    made[0].says(JSON.stringify({ t: "camera_state", camera: "head", refusal }));
    made[0].says(JSON.stringify({ t: "bridge_gone", refusal }));
    expect(heard.slice(1)).toEqual([
      ["cameras", [{ name: "head" }]],
      ["state", expect.objectContaining({ camera: "head", refusal })],
      ["state", { camera: null, refusal }],
    ]);
  });

  it.each([4401, 4403, 4404])("stays away after a close with %s", (code) => {
    opened();
    made[0].close(code);
    vi.advanceTimersByTime(60_000);
    expect(made).toHaveLength(1);
    expect(heard.at(-1)[0]).toBe("down");
  });

  it("connects again when nothing is heard, pictures included", () => {
    opened();
    socket.watch("head", "full");
    for (let i = 0; i < 8; i += 1) {
      vi.advanceTimersByTime(1000);
      made[0].says(packed(headerOf(i)));
    }
    expect(made).toHaveLength(1);
    vi.advanceTimersByTime(6500);
    expect(made.length).toBeGreaterThan(1);
  });
});
