/** The connection for a robot's cameras, apart from control: receives and acknowledges pictures. */

import { Heartbeat } from "../connection/heartbeat.js";
import { CLOSED_FOR_GOOD, LiveSocket } from "../connection/socket.js";
import { ConsoleClock } from "./console_clock.js";
import { unpacked } from "./frame.js";

const RATE_HZ = 30; // at most: the console sends as many as the network can carry

/**
 * Open only while a camera is shown, or will be shown soon. While the page is hidden, no camera is watched.
 * Events: "open", "down" (detail: {isOver}; `isOver`: it does not connect again), "cameras" (detail: their
 * list), "picture" (detail: {header, bytes, takenMs}; `takenMs` by this page's clock), "state" (detail:
 * {camera, refusal}; `camera` null: all of them), "notice", "refused" (detail: as sent).
 */
export class CameraSocket extends EventTarget {
  #url;
  #rateHz;
  #video = false;
  #socket = null;
  #heartbeat = null;
  #clock = new ConsoleClock();
  #watched = new Map(); // sizes by camera
  #isOver = false; // the console closed it for good
  #listening = null; // aborted by close(), so that messages of a closed socket are ignored

  /**
   * @param {string} url of the WebSocket
   * @param {Promise<boolean>} video whether this browser decodes H.264
   * @param {number} rateHz the most pictures a second
   */
  constructor(url, video, rateHz = RATE_HZ) {
    super();
    this.#url = url;
    this.#rateHz = rateHz;
    video.then((can) => {
      if (!can) return;
      this.#video = true;
      this.#watchAsSeen();
    });
  }

  get isOpen() {
    return Boolean(this.#socket?.open);
  }

  /** Connects, unless the console has closed the connection for good: then the page must be loaded again. */
  open() {
    if (this.#socket || this.#isOver) return;
    this.#socket = new LiveSocket(this.#url);
    this.#heartbeat = new Heartbeat(this.#socket);
    this.#listening = new AbortController();
    const { signal } = this.#listening;
    const on = (type, act) =>
      this.#socket.addEventListener(type, ({ detail }) => act(detail), { signal });
    on("open", () => this.#opened());
    on("down", ({ code }) => this.#lost(code));
    on("message", (message) => this.#receive(message));
    on("bytes", (frame) => this.#received(frame));
    document.addEventListener("visibilitychange", () => this.#watchAsSeen(), { signal });
    this.#socket.connect();
  }

  close() {
    if (!this.#socket) return;
    this.#listening.abort();
    this.#heartbeat.close();
    this.#socket.close();
    this.#socket = null;
    this.#emit("down", { isOver: this.#isOver });
  }

  /** @param {string} camera @param {"full" | "small"} size */
  watch(camera, size) {
    if (this.#watched.get(camera) === size) return;
    this.#watched.set(camera, size);
    if (!document.hidden) this.#sendWatch(camera, size);
  }

  end(camera) {
    if (this.#watched.delete(camera)) this.#socket?.send({ t: "camera_end", camera });
  }

  /** Acknowledge a picture: it was painted, was left out for a newer one, or could not be decoded. */
  acknowledge({ camera, number }, damaged) {
    const message = { t: "camera_ack", camera, number };
    this.#socket?.send(damaged ? { ...message, damaged } : message);
  }

  #sendWatch(camera, size) {
    this.#socket?.send({
      t: "camera_watch",
      camera,
      video: this.#video,
      rate_hz: this.#rateHz,
      size,
    });
  }

  #watchAsSeen() {
    for (const [camera, size] of this.#watched) {
      if (document.hidden) this.#socket?.send({ t: "camera_end", camera });
      else this.#sendWatch(camera, size);
    }
  }

  #opened() {
    this.#heartbeat.begin();
    this.#clock.clear();
    this.#socket.send({ t: "ping", sent_ms: performance.now() }); // so that the first picture has an age, too
    if (!document.hidden) this.#watchAsSeen();
    this.#emit("open");
  }

  #lost(code) {
    this.#isOver = CLOSED_FOR_GOOD.has(code);
    if (this.#isOver) this.close();
    else this.#emit("down", { isOver: false });
  }

  #receive(message) {
    this.#heartbeat.receive(message);
    switch (message.t) {
      case "camera_pong":
        return this.#clock.receive(message, performance.now());
      case "cameras":
        return this.#emit("cameras", message.cameras);
      case "camera_state":
        return this.#emit("state", message);
      case "bridge_gone":
        return this.#emit("state", { camera: null, refusal: message.refusal });
      case "notice":
      case "refused":
        return this.#emit(message.t, message);
    }
  }

  #received(frame) {
    this.#heartbeat.receive({});
    const picture = unpacked(frame);
    if (!picture) return;
    // It was sent before the page stopped watching its camera.
    if (!this.#watched.has(picture.header.camera)) return;
    const takenMs = this.#clock.here(picture.header.taken_ms) ?? performance.now();
    this.#emit("picture", { ...picture, takenMs });
  }

  #emit(type, detail = null) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}
