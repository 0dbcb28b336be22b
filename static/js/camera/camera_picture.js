/** Paints one camera's pictures on a canvas, never an older picture after a newer one. */

import { fits } from "./frame.js";
import { paintScale, scaleText } from "./scale.js";
import { VideoStream } from "./video.js";

const IMAGES = new Set(["jpeg", "png"]);

/**
 * Events: "painted" (detail: {header, takenMs}), "done" (detail: {header, damaged}): the picture may be
 * acknowledged. A picture that cannot be decoded is reported as damaged, and changes nothing else.
 */
export class CameraPicture extends EventTarget {
  #canvas;
  #pen;
  #video;
  #waiting = null; // an image that waits for the decoder; a newer image replaces it
  #decodes = false;
  #taken = new Map(); // of the pictures in a decoder: the times at which they were taken, by number
  #painted = null;
  #newest = -1; // number of the picture painted last
  #round = 0; // grows with each camera or connection: a picture of an earlier round is not painted

  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    super();
    this.#canvas = canvas;
    this.#pen = canvas.getContext("2d", { alpha: false });
    this.#begin();
  }

  /** The picture on the canvas: {header, takenMs}, or null. */
  get painted() {
    return this.#painted;
  }

  /** @param {{header: object, bytes: Uint8Array, takenMs: number}} picture */
  take(picture) {
    const { header, bytes, takenMs } = picture;
    const isVideo = header.format === "h264";
    if (!fits(header) || !(isVideo || IMAGES.has(header.format))) return this.#done(header, true);
    this.#taken.set(header.number, takenMs);
    if (isVideo) return this.#video.decode(header, bytes);
    if (this.#waiting) this.#done(this.#waiting.header, false);
    this.#waiting = picture;
    if (!this.#decodes) this.#decodeImages();
  }

  /** Begin with another camera: remove the picture of the earlier camera. */
  clear() {
    this.renumber();
    this.#painted = null;
    this.#pen.clearRect(0, 0, this.#canvas.width, this.#canvas.height);
  }

  /** Begin with another connection: the next picture may have any number. */
  renumber() {
    this.#video.close();
    this.#begin();
    this.#newest = -1;
  }

  /** @returns {Promise<?Blob>} the picture as a file: lossless if it was sent lossless */
  file() {
    const isLossless = this.#painted?.header.format === "png";
    return new Promise((resolve) =>
      this.#canvas.toBlob(resolve, isLossless ? "image/png" : "image/jpeg", 0.92),
    );
  }

  close() {
    this.#round += 1;
    this.#waiting = null;
    this.#video.close();
  }

  #begin() {
    this.#round += 1;
    this.#waiting = null;
    this.#taken.clear();
    const round = this.#round;
    this.#video = new VideoStream({
      paint: (header, frame) => {
        if (round !== this.#round) return;
        this.#paint(header, frame, frame.displayWidth, frame.displayHeight);
        this.#done(header, false);
      },
      damaged: (header) => this.#done(header, true),
    });
  }

  async #decodeImages() {
    this.#decodes = true;
    while (this.#waiting) {
      const { header, bytes } = this.#waiting;
      const round = this.#round;
      this.#waiting = null;
      const bitmap = await decoded(header, bytes);
      if (bitmap && round === this.#round) this.#paint(header, bitmap, bitmap.width, bitmap.height);
      bitmap?.close();
      if (round === this.#round) this.#done(header, bitmap === null);
    }
    this.#decodes = false;
  }

  #paint(header, source, width, height) {
    if (header.number < this.#newest) return;
    this.#newest = header.number;
    const canvas = this.#canvas;
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    this.#pen.drawImage(source, 0, 0);
    paintScale(this.#pen, scaleText(header.scale), width, height);
    this.#painted = { header, takenMs: this.#taken.get(header.number) };
    this.#emit("painted", this.#painted);
  }

  #done(header, damaged) {
    this.#taken.delete(header.number);
    this.#emit("done", { header, damaged });
  }

  #emit(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}

/** @returns {Promise<?ImageBitmap>} null: the image is damaged */
async function decoded({ format }, bytes) {
  try {
    return await createImageBitmap(new Blob([bytes], { type: `image/${format}` }));
  } catch {
    return null;
  }
}
