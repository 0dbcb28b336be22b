import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { CameraPicture } from "../../../static/js/camera/camera_picture.js";
import { headerOf, recordingCanvas } from "./frames.js";

/** A decoder that finishes each picture only when the test asks for this. */
function slowDecoder() {
  const asked = [];
  const decode = (blob) =>
    new Promise((resolve, reject) => {
      const image = { width: 320, height: 240, type: blob.type, close: vi.fn() };
      asked.push({ image, done: () => resolve(image), fail: () => reject(new Error("broken")) });
    });
  return { asked, decode };
}

describe("a camera's picture", () => {
  let canvas;
  let painted;
  let asked;
  let picture;
  let done;
  const settle = () => new Promise((resolve) => setTimeout(resolve));
  const take = (number, rest = {}) =>
    picture.take({
      header: headerOf(number, rest),
      bytes: new Uint8Array(3),
      takenMs: 10 * number,
    });

  beforeEach(() => {
    ({ canvas, painted } = recordingCanvas());
    const decoder = slowDecoder();
    asked = decoder.asked;
    vi.stubGlobal("createImageBitmap", decoder.decode);
    picture = new CameraPicture(canvas);
    done = [];
    picture.addEventListener("done", ({ detail }) =>
      done.push([detail.header.number, detail.damaged]),
    );
  });

  afterEach(() => {
    picture.close();
    vi.unstubAllGlobals();
  });

  it("paints, acknowledges, and frees the bitmap", async () => {
    take(1, { format: "png" });
    expect(asked[0].image.type).toBe("image/png");
    expect(done).toEqual([]);
    asked[0].done();
    await settle();
    expect(painted).toEqual([asked[0].image]);
    expect([canvas.width, canvas.height]).toEqual([320, 240]);
    expect(asked[0].image.close).toHaveBeenCalledTimes(1);
    expect(done).toEqual([[1, false]]);
    expect(picture.painted).toEqual({ header: headerOf(1, { format: "png" }), takenMs: 10 });
  });

  it("leaves out all but the newest while it decodes", async () => {
    for (const number of [1, 2, 3]) take(number);
    asked[0].done();
    await settle();
    asked[1].done();
    await settle();
    expect(asked).toHaveLength(2);
    expect(done).toEqual([
      [2, false],
      [1, false],
      [3, false],
    ]);
    expect(picture.painted.header.number).toBe(3);
  });

  it("acknowledges a damaged picture as damaged, and goes on", async () => {
    take(1);
    asked[0].fail();
    await settle();
    take(2);
    asked[1].done();
    await settle();
    expect(done).toEqual([
      [1, true],
      [2, false],
    ]);
    expect(picture.painted.header.number).toBe(2);
  });

  it.each([{ width: 4097 }, { height: 5000 }, { width: 0 }, { format: "gif" }, { width: "many" }])(
    "does not decode a picture with %s",
    (rest) => {
      take(1, rest);
      expect(asked).toEqual([]);
      expect(done).toEqual([[1, true]]);
    },
  );

  it("paints no picture of an earlier connection", async () => {
    take(9);
    picture.clear();
    asked[0].done();
    await settle();
    expect(painted).toEqual([]);
    expect(asked[0].image.close).toHaveBeenCalledTimes(1);
    take(1);
    asked[1].done();
    await settle();
    expect(picture.painted.header.number).toBe(1);
  });
});

/** The part of WebCodecs that the page uses. */
class FakeDecoder {
  static made = [];
  state = "unconfigured";
  chunks = [];

  constructor(ways) {
    this.ways = ways;
    FakeDecoder.made.push(this);
  }

  configure(config) {
    this.state = "configured";
    this.config = config;
  }

  decode(chunk) {
    this.chunks.push(chunk);
  }

  close() {
    this.state = "closed";
  }

  gives(timestamp) {
    const frame = { timestamp, displayWidth: 640, displayHeight: 480, close: vi.fn() };
    this.ways.output(frame);
    return frame;
  }
}

describe("a camera's video", () => {
  let painted;
  let picture;
  let done;
  const take = (number, key = false) =>
    picture.take({
      header: headerOf(number, { format: "h264", key }),
      bytes: new Uint8Array(3),
      takenMs: 0,
    });

  beforeEach(() => {
    FakeDecoder.made = [];
    vi.stubGlobal("VideoDecoder", FakeDecoder);
    vi.stubGlobal(
      "EncodedVideoChunk",
      class {
        constructor(facts) {
          Object.assign(this, facts);
        }
      },
    );
    let canvas;
    ({ canvas, painted } = recordingCanvas());
    picture = new CameraPicture(canvas);
    done = [];
    picture.addEventListener("done", ({ detail }) =>
      done.push([detail.header.number, detail.damaged]),
    );
  });

  afterEach(() => {
    picture.close();
    vi.unstubAllGlobals();
  });

  it("decodes in order from a key picture on", () => {
    take(4, true);
    take(5);
    const [decoder] = FakeDecoder.made;
    expect(decoder.config).toEqual({ codec: "avc1.42E01F", optimizeForLatency: true });
    expect(decoder.chunks.map(({ type, timestamp }) => [type, timestamp])).toEqual([
      ["key", 4],
      ["delta", 5],
    ]);
    const frame = decoder.gives(4);
    expect(painted).toEqual([frame]);
    expect(frame.close).toHaveBeenCalledTimes(1);
    expect(done).toEqual([[4, false]]);
  });

  it("waits for a key picture at the beginning", () => {
    take(1);
    expect(FakeDecoder.made).toEqual([]);
    take(2, true);
    take(4); // number 3 is another picture of this camera, which this page did not get
    FakeDecoder.made[0].gives(2);
    FakeDecoder.made[0].gives(4);
    expect(done).toEqual([
      [1, true],
      [2, false],
      [4, false],
    ]);
  });

  it("acknowledges as damaged what the decoder rejects", () => {
    take(1, true);
    take(2);
    FakeDecoder.made[0].ways.error(new Error("broken"));
    expect(done).toEqual([
      [1, true],
      [2, true],
    ]);
    take(3);
    take(4, true);
    expect(done.at(-1)).toEqual([3, true]);
    FakeDecoder.made[1].gives(4);
    expect(done.at(-1)).toEqual([4, false]);
  });
});
