/** One camera on the page: its picture, the age of the picture, or the reason why there is no picture. */

import { ageText } from "../formats/ages.js";
import { make, mark, setTextOrHide } from "../lib/dom.js";
import { CameraPicture } from "./camera_picture.js";
import { scaleText } from "./scale.js";

const SAID_MS = 300; // the age of a newer picture is not shown
const OLD_MS = 500; // an older picture is grey

/** Return the text about a picture's age; empty while the picture is new. */
export function pictureText(ageMs) {
  return ageMs > SAID_MS ? interpolate(gettext("picture %s old"), [ageText(ageMs)]) : "";
}

/** robot-camera-time, in local time. @param {Date} date */
export function fileName(robot, camera, date, type) {
  const two = (value) => String(value).padStart(2, "0");
  const day = [date.getFullYear(), two(date.getMonth() + 1), two(date.getDate())].join("-");
  const time = [date.getHours(), date.getMinutes(), date.getSeconds()].map(two).join("-");
  return `${robot}-${camera}-${day}-${time}.${type === "image/png" ? "png" : "jpg"}`;
}

/** Events: "done" (as of `CameraPicture`), "painted" (detail: the header). */
export class CameraView extends EventTarget {
  #element;
  #canvas;
  #age;
  #words;
  #picture;
  #camera = null;
  #why = ""; // why there are no pictures
  #isDamaged = false; // whether the newest picture was damaged

  /** @param {HTMLElement} element holds .camera-picture (a canvas), .camera-age and .camera-words */
  constructor(element) {
    super();
    this.#element = element;
    this.#canvas = element.querySelector(".camera-picture");
    this.#age = element.querySelector(".camera-age");
    this.#words = element.querySelector(".camera-words");
    this.#picture = new CameraPicture(this.#canvas);
    this.#picture.addEventListener("painted", ({ detail }) => this.#onPainted(detail));
    this.#picture.addEventListener("done", ({ detail }) => this.#onDone(detail));
  }

  /** @param {?object} camera as in the console's list; null: no camera is shown here */
  set camera(camera) {
    const isNew = camera?.name !== this.#camera?.name;
    this.#camera = camera;
    if (camera) this.#sayLabel();
    if (isNew) this.begin();
  }

  get camera() {
    return this.#camera;
  }

  /** The header of the picture that is shown, or null. */
  get header() {
    return this.#picture.painted?.header ?? null;
  }

  /** Age of the shown picture; null: no picture is shown. */
  get ageMs() {
    const { painted } = this.#picture;
    return painted ? Math.max(0, performance.now() - painted.takenMs) : null;
  }

  /** @param {string} text why there are no pictures; empty: there is no fault */
  set why(text) {
    this.#why = text;
    this.update();
  }

  take(picture) {
    this.#picture.take(picture);
  }

  /** Show this camera from the beginning: without a picture, until the first one comes. */
  begin() {
    this.#picture.clear();
    this.#why = "";
    this.#isDamaged = false;
    this.update();
  }

  /** A new connection: the next picture may have any number; the last one stays. */
  again() {
    this.#picture.renumber();
  }

  /** Show the age of the picture. Called again and again: the age grows also while no picture comes. */
  update() {
    const ageMs = this.ageMs;
    const isOld = ageMs !== null && ageMs > OLD_MS;
    mark(this.#element, "old", isOld);
    setTextOrHide(this.#age, ageMs === null ? "" : pictureText(ageMs));
    setTextOrHide(this.#words, this.#text(ageMs));
  }

  /**
   * Save the picture to a file, which is named by the time at which it was taken.
   * @param {string} robot its slug
   */
  async save(robot) {
    const { ageMs } = this;
    if (ageMs === null) return;
    const taken = new Date(Date.now() - ageMs);
    const file = await this.#picture.file();
    if (!file) return;
    const link = make("a");
    link.href = URL.createObjectURL(file);
    link.download = fileName(robot, this.#camera.name, taken, file.type);
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href));
  }

  close() {
    this.#picture.close();
  }

  #sayLabel() {
    const words = [this.#camera?.label, scaleText(this.header?.scale)].filter(Boolean);
    this.#canvas.setAttribute("aria-label", words.join(", "));
  }

  #text(ageMs) {
    if (this.#why) return this.#why;
    if (this.#isDamaged) return gettext("The picture came damaged.");
    return ageMs === null ? gettext("Waiting for the first picture.") : "";
  }

  #onPainted({ header }) {
    this.#why = "";
    this.#sayLabel();
    this.update();
    this.dispatchEvent(new CustomEvent("painted", { detail: header }));
  }

  #onDone(detail) {
    this.#isDamaged = detail.damaged;
    this.update();
    this.dispatchEvent(new CustomEvent("done", { detail }));
  }
}
