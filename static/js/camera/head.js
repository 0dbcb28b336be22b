/**
 * Turns the robot's head: by drag, click and double click on the picture, and by buttons for the keyboard. A click on
 * the floor near the robot only points there: the person then chooses to drive or to look there.
 */

import { whyNotNow } from "../control/lease.js";
import { PointerGrip } from "../hand/pointer_grip.js";
import { dim, mark, show } from "../lib/dom.js";
import { seen } from "./floor_geometry.js";
import { covering, pixelUnder } from "./frame.js";

const PERIOD_MS = 200; // five requests a second are enough to follow a finger
const DRAG_PX = 8; // a finger that moves less does not drag
const DOUBLE_MS = 300;
const STEP_RAD = 0.15; // for each press of a button
const MOST_WAITING = 2; // requests without an answer: on a stalled network they would all arrive at once
const STEPS = { left: [1, 0], right: [-1, 0], up: [0, 1], down: [0, -1] };

/** Return the lens of a picture; if it is not known, a lens that robots often have: 53 degrees wide. */
function lensOf({ lens, width, height }) {
  return lens ?? [width, width, width / 2, height / 2];
}

/** Return the turn by which the picture follows a finger; pixels of the header. Left and up are positive. */
export function turnByDrag(right, down, header) {
  const [fx, fy] = lensOf(header);
  return { pan: Math.atan(right / fx), tilt: Math.atan(down / fy) };
}

/** Return heading and elevation, in the base frame, of an optical direction; `m` is a header's pose. */
function directionOf([x, y, z], m) {
  const [ahead, left, up] = [0, 1, 2].map(
    (axis) => m[axis] * x + m[4 + axis] * y + m[8 + axis] * z,
  );
  return { heading: Math.atan2(left, ahead), elevation: Math.atan2(up, Math.hypot(ahead, left)) };
}

/**
 * Return the turn that brings a point to the picture's middle. The neck pans about the vertical, also if the
 * head looks down.
 */
export function turnToPoint(u, v, header) {
  const [fx, fy, cx, cy] = lensOf(header);
  const [left, up] = [(cx - u) / fx, (cy - v) / fy];
  if (!header.pose) return { pan: Math.atan(left), tilt: Math.atan(up) };
  const turn = turnTowards([-left, -up, 1], header.pose);
  // The point is behind the floor below the camera: the neck must not turn round for it.
  const isBelow = Math.abs(turn.pan) > Math.PI / 2;
  return isBelow ? { pan: Math.atan(left), tilt: Math.atan(up) } : turn;
}

/** Return the turn from the camera's axis to an optical direction. */
function turnTowards(direction, pose) {
  const now = directionOf([0, 0, 1], pose);
  const wanted = directionOf(direction, pose);
  const turn = wanted.heading - now.heading;
  return {
    pan: Math.atan2(Math.sin(turn), Math.cos(turn)),
    tilt: wanted.elevation - now.elevation,
  };
}

export class Head {
  #area;
  #keys;
  #request;
  #header;
  #point;
  #moves = false;
  #may = false;
  #finger;
  #drag = null; // {x, y, startX, startY, isDrag} while the finger is down
  #pendingTurn = { pan: 0, tilt: 0 };
  #waiting = 0; // requests without an answer
  #late = 0; // how many of them got no answer in time
  #sentMs = -Infinity;
  #timer = null;
  #click = null; // a click that may become a double click
  #listening = new AbortController();

  /**
   * @param {HTMLElement} area the picture
   * @param {HTMLElement} keys holds buttons with data-turn: left, right, up, down, ahead
   * @param {object} ways
   * @param {(request: object) => Promise<?object>} ways.request sends a request; returns the refusal or null
   * @param {() => ?object} ways.header of the picture that is shown
   * @param {(pixel: ?number[]) => boolean} ways.point gets a click, also while the head may not be turned; null: the
   *   click was the first of two. Returns whether the click points at the floor near the robot
   */
  constructor(area, keys, { request, header, point }) {
    this.#area = area;
    this.#keys = keys;
    this.#request = request;
    this.#header = header;
    this.#point = point;
    const { signal } = this.#listening;
    this.#finger = new PointerGrip(area, {
      begin: (event) => this.#down(event),
      move: (event) => this.#move(event),
      end: (lost, event) => this.#up(lost, event),
      patienceMs: Infinity, // a finger that rests turns nothing
      hasMenu: true,
    });
    keys.addEventListener("click", ({ target }) => this.#press(target.closest("[data-turn]")), {
      signal,
    });
    const onlyPoints = (event) => {
      if (!this.#turns && this.#header()) this.#point(this.#pixelAt(event));
    };
    area.addEventListener("click", onlyPoints, { signal });
    this.#follow();
  }

  /** @param {boolean} moves whether dragging the shown camera's picture turns the head */
  set moves(moves) {
    this.#moves = moves;
    show(this.#keys, moves);
    this.#follow();
  }

  /** @param {boolean} may whether this tab has control */
  set mayAct(may) {
    this.#may = may;
    for (const key of this.#keys.querySelectorAll("[data-turn]")) dim(key, !may, whyNotNow());
    this.#follow();
  }

  /** Turn the head to a point of the floor, in the base frame, if the picture tells where the camera looks. */
  lookAt(point) {
    const pose = this.#header()?.pose;
    if (pose) this.#look(turnTowards(seen(point, pose), pose));
  }

  close() {
    this.#listening.abort();
    this.#end();
    this.#finger.close();
  }

  get #turns() {
    return this.#moves && this.#may;
  }

  #follow() {
    mark(this.#area, "turns", this.#turns);
    if (!this.#turns) this.#end();
  }

  #end() {
    this.#finger.drop("ended");
    this.#setPending(0, 0);
    clearTimeout(this.#click?.timer);
    this.#click = null;
  }

  #down({ clientX: x, clientY: y }) {
    if (!this.#turns || !this.#header()) return false;
    this.#drag = { x, y, startX: x, startY: y, isDrag: false };
    this.#waiting = this.#late = 0;
    return true;
  }

  #move({ clientX, clientY }) {
    const drag = this.#drag;
    const gone = Math.hypot(clientX - drag.startX, clientY - drag.startY);
    if (!drag.isDrag && gone < DRAG_PX) return;
    drag.isDrag = true;
    const { header, scale } = this.#pictureOnPage();
    const right = (clientX - drag.x) / scale;
    const down = (clientY - drag.y) / scale;
    drag.x = clientX;
    drag.y = clientY;
    const { pan, tilt } = turnByDrag(right, down, header);
    this.#pendingTurn = { pan: this.#pendingTurn.pan + pan, tilt: this.#pendingTurn.tilt + tilt };
    this.#sendSoon();
  }

  #up(lost, event) {
    const { isDrag } = this.#drag;
    this.#drag = null;
    if (lost) return this.#setPending(0, 0);
    if (isDrag) return;
    if (this.#click) {
      clearTimeout(this.#click.timer);
      this.#click = null;
      this.#point(null);
      this.#ask({ t: "look_ahead" });
      return;
    }
    const pixel = this.#pixelAt(event);
    const turn = turnToPoint(...pixel, this.#header());
    const isFloor = this.#point(pixel);
    const timer = setTimeout(() => {
      this.#click = null;
      if (!isFloor) this.#look(turn);
    }, DOUBLE_MS);
    this.#click = { timer };
  }

  #pixelAt({ clientX, clientY }) {
    const { left, top, width, height } = this.#area.getBoundingClientRect();
    return pixelUnder([clientX - left, clientY - top], this.#header(), width, height);
  }

  /** Return the picture's header, and its scale on the page. */
  #pictureOnPage() {
    const header = this.#header();
    const { width, height } = this.#area.getBoundingClientRect();
    return { header, scale: covering(header, width, height).scale };
  }

  #press(key) {
    if (!key) return;
    const step = STEPS[key.dataset.turn];
    if (step) this.#look({ pan: step[0] * STEP_RAD, tilt: step[1] * STEP_RAD });
    else this.#ask({ t: "look_ahead" });
  }

  #sendSoon() {
    if (this.#timer !== null || this.#waiting >= MOST_WAITING) return;
    const waitMs = Math.max(0, this.#sentMs + PERIOD_MS - performance.now());
    this.#timer = setTimeout(() => {
      const turn = this.#pendingTurn;
      this.#setPending(0, 0);
      this.#look(turn);
    }, waitMs);
  }

  #look({ pan, tilt }) {
    this.#sentMs = performance.now();
    this.#ask({ t: "turn_head", pan, tilt });
  }

  /**
   * Send a request. A refusal ends the drag: the next part would be refused, too. A late request still counts
   * as waiting.
   */
  async #ask(request) {
    this.#waiting += 1;
    const refusal = await this.#request({ ...request, quiet: true });
    if (refusal?.code === "no_answer") {
      this.#late += 1;
      return this.#setPending(0, 0);
    }
    // An answer came: late requests do not count any more.
    this.#waiting = Math.max(0, this.#waiting - 1 - this.#late);
    this.#late = 0;
    if (refusal) this.#end();
    else if (this.#pendingTurn.pan || this.#pendingTurn.tilt) this.#sendSoon();
  }

  #setPending(pan, tilt) {
    this.#pendingTurn = { pan, tilt };
    clearTimeout(this.#timer);
    this.#timer = null;
  }
}
