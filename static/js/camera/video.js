/**
 * Decodes H.264 pictures by the browser's own decoder (WebCodecs): only on https, and not in every browser.
 */

const CONFIG = { codec: "avc1.42E01F", optimizeForLatency: true }; // without a description: Annex B

/** @returns {Promise<boolean>} */
export async function decodesVideo() {
  if (!globalThis.VideoDecoder) return false;
  try {
    return Boolean((await VideoDecoder.isConfigSupported(CONFIG)).supported);
  } catch {
    return false;
  }
}

/** Decodes in order, from a key picture on; after damage, it waits for the next key picture. */
export class VideoStream {
  #painter;
  #decoder = null;
  #waiting = new Map(); // headers in the decoder, by number

  /**
   * @param {object} painter
   * @param {(header: object, frame: VideoFrame) => void} painter.paint draws a frame, which is then closed
   * @param {(header: object) => void} painter.damaged
   */
  constructor(painter) {
    this.#painter = painter;
  }

  decode(header, bytes) {
    const { number, key } = header;
    if (key) this.#begin();
    else if (!this.#decoder) return this.#painter.damaged(header);
    this.#waiting.set(number, header);
    const type = key ? "key" : "delta";
    try {
      this.#decoder.decode(new EncodedVideoChunk({ type, timestamp: number, data: bytes }));
    } catch {
      this.#fail();
    }
  }

  close() {
    this.#waiting.clear();
    if (this.#decoder && this.#decoder.state !== "closed") this.#decoder.close();
    this.#decoder = null;
  }

  #begin() {
    if (this.#decoder) return;
    const decoder = new VideoDecoder({
      output: (frame) => this.#decoded(frame),
      error: () => decoder === this.#decoder && this.#fail(),
    });
    this.#decoder = decoder;
    decoder.configure(CONFIG);
  }

  #decoded(frame) {
    const header = this.#waiting.get(frame.timestamp);
    this.#waiting.delete(frame.timestamp);
    if (header) this.#painter.paint(header, frame);
    frame.close();
  }

  /** Close the decoder; all pictures in it are lost and reported as damaged. */
  #fail() {
    const lost = [...this.#waiting.values()];
    this.close();
    for (const header of lost) this.#painter.damaged(header);
  }
}
