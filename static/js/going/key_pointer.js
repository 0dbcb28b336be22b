/**
 * Pointing by keys in a picture of the floor: Enter begins, a cross then follows the arrow keys, Enter chooses, Escape
 * ends. Meanwhile no key of the page drives; Space still stops. The mode begins by a key, never by the focus alone: a
 * press with the mouse brings the focus, too, and a person who then holds an arrow key wants to drive.
 */

import { number } from "../formats/numbers.js";
import { hand, isModified } from "../hand/watch.js";
import { make, setText, show } from "../lib/dom.js";

const STEPS = { ArrowUp: [0, -1], ArrowDown: [0, 1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] };
const STEP_SHARE = 1 / 40; // of the picture's height

/** Return a point of the floor in words. @param {number[]} point in the base frame, metres */
export function placeText([ahead, left]) {
  const along = ahead < 0 ? gettext("%s m behind") : gettext("%s m ahead");
  const aside = left < 0 ? gettext("%s m to the right") : gettext("%s m to the left");
  return [
    [along, ahead],
    [aside, left],
  ]
    .map(([text, metres]) => interpolate(text, [number(Math.abs(metres), 1)]))
    .join(", ");
}

export class KeyPointer {
  #element;
  #words;
  #pointAt;
  #choose;
  #cross = make("span", { className: "key-cross" });
  #begins;
  #at; // shares of width and height
  #points = false;
  #listening = new AbortController();

  /**
   * @param {HTMLElement} element the picture, which takes the focus
   * @param {HTMLElement} words a live region: where the cross is
   * @param {object} ways
   * @param {number[]} ways.begins where the cross is first: shares of width and height
   * @param {(spot: number[]) => ?number[]} ways.pointAt the point of the floor at a spot of the element (page pixels), in
   *   the base frame; null: there is no floor near the robot
   * @param {(point: number[]) => void} ways.choose
   */
  constructor(element, words, { begins, pointAt, choose }) {
    this.#begins = this.#at = begins;
    this.#element = element;
    this.#words = words;
    this.#pointAt = pointAt;
    this.#choose = choose;
    element.tabIndex = 0;
    element.after(this.#cross);
    show(this.#cross, false);
    const { signal } = this.#listening;
    element.addEventListener("keydown", (event) => this.#typed(event), { signal });
    element.addEventListener("blur", () => this.#end(), { signal });
  }

  close() {
    this.#listening.abort();
    this.#cross.remove();
  }

  #typed(event) {
    if (isModified(event) || event.code === "Space" || event.key === "Tab") return;
    if (event.key === "Enter") this.#enter(event);
    else if (!this.#points) return;
    else if (event.key === "Escape")
      return this.#end(); // the page removes the ghost
    else if (event.key in STEPS) this.#move(STEPS[event.key]);
    else if (event.key.length > 1) return; // no letter: a key of the browser
    event.preventDefault();
    event.stopPropagation();
  }

  #enter({ repeat }) {
    if (repeat) return;
    if (!this.#points) return this.#begin();
    const point = this.#point;
    this.#end();
    this.#choose(point);
  }

  #begin() {
    if (!this.#point) this.#at = this.#begins;
    if (!this.#point)
      return setText(this.#words, gettext("The picture shows no floor near the robot."));
    hand.loseKeys();
    this.#points = true;
    show(this.#cross, true);
    this.#say();
  }

  #end() {
    if (!this.#points) return;
    this.#points = false;
    show(this.#cross, false);
    setText(this.#words, "");
  }

  /** Move the cross by a step; not beyond the floor near the robot. */
  #move([right, down]) {
    const before = this.#at;
    const { clientWidth: width, clientHeight: height } = this.#element;
    const step = STEP_SHARE * height;
    this.#at = [before[0] + (right * step) / width, before[1] + (down * step) / height];
    if (this.#at.some((share) => share < 0 || share > 1) || !this.#point) this.#at = before;
    this.#say();
  }

  get #point() {
    const { clientWidth: width, clientHeight: height } = this.#element;
    return this.#pointAt([this.#at[0] * width, this.#at[1] * height]);
  }

  #say() {
    this.#cross.style.setProperty("--right", String(this.#at[0]));
    this.#cross.style.setProperty("--down", String(this.#at[1]));
    setText(this.#words, placeText(this.#point));
  }
}
