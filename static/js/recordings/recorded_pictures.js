/** The camera of a replay: one picture is read at a time, then the one of the moment by then. */

import { make, setText, setTextOrHide, show } from "../lib/dom.js";
import { topics } from "./channels.js";

const STEP_S = 0.25; // two moments this close show the same picture

/** Return the topic that shows most at first: compressed pictures in colour. Pure. */
export function firstPicture(channels) {
  const rank = ({ topic, type }) =>
    (type.endsWith("CompressedImage") ? 2 : 0) +
    (/depth/i.test(topic) ? -4 : 0) +
    (/rgb|color/i.test(topic) ? 1 : 0);
  return channels.toSorted((one, other) => rank(other) - rank(one))[0]?.topic ?? "";
}

/** Return a moment with milliseconds, not later than it is: the server shows nothing after a part. Pure. */
export function milliseconds(atS) {
  return (Math.floor(atS * 1000) / 1000).toFixed(3);
}

export class RecordedPictures {
  #parts;
  #address;
  #shown = ""; // address of the picture that is shown or read
  #wanted = "";
  #isReading = false;
  #atS = 0;

  /** @param {Record<string, HTMLElement>} parts @param {string} address of the recording */
  constructor(parts, address) {
    this.#parts = parts;
    this.#address = address;
    parts.camera.addEventListener("load", () => this.#done(true));
    parts.camera.addEventListener("error", () => this.#done(false));
    parts["camera-topic"].addEventListener("change", () => this.#want());
  }

  /** @param {object[]} channels of the recording */
  set channels(channels) {
    const pictures = channels.filter(({ picture, messages }) => picture && messages);
    const choice = this.#parts["camera-topic"];
    choice.replaceChildren(...topics(pictures).map((topic) => make("option", { text: topic })));
    show(choice, topics(pictures).length > 1);
    if (!pictures.length) setText(this.#parts["camera-words"], gettext("No picture was recorded."));
    choice.value = firstPicture(pictures);
    this.#want();
  }

  /** @param {number} atS the moment @param {[number, number]} part after which no picture is read */
  show(atS, [, endS]) {
    this.#atS = Math.min(Math.ceil(atS / STEP_S) * STEP_S, endS);
    this.#want();
  }

  #want() {
    const topic = this.#parts["camera-topic"].value;
    if (!topic) return;
    const asked = new URLSearchParams({ topic, at: milliseconds(this.#atS) });
    this.#wanted = `${this.#address}/picture?${asked}`;
    this.#read();
  }

  #read() {
    if (this.#isReading || this.#wanted === this.#shown) return;
    this.#isReading = true;
    this.#shown = this.#wanted;
    this.#parts.camera.src = this.#shown;
  }

  #done(isThere) {
    this.#isReading = false;
    show(this.#parts.camera, isThere);
    setTextOrHide(
      this.#parts["camera-words"],
      isThere ? "" : gettext("No picture was recorded until this moment."),
    );
    this.#read();
  }
}
