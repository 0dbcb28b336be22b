/**
 * The map with the robot on it. Wheel, pinch and keys zoom and move the map; a drag chooses a point and a
 * heading, or turns the ghost; a press picks a place, a robot or a point. It sends
 * nothing: `map_panel.js` makes requests of its events.
 */

import { hand } from "../hand/watch.js";
import { Canvas } from "../lib/canvas.js";
import { corners, headingOf, panned, toPixels, toPoint, whole, zoomed } from "./map_frame.js";
import { placed } from "./map_labels.js";
import {
  drawGhost,
  drawGoal,
  drawLaser,
  drawPath,
  drawPicture,
  drawPlace,
  drawRobot,
  GOAL_PX,
  robotSize,
} from "./map_symbols.js";

const COLOURS = [
  "surface",
  "grid-text",
  "laser",
  "robot",
  "robot-edge",
  "path",
  "path-body",
  "hold",
  "place",
  "alarm",
];
const ZOOM_STEP = 1.4;
const PAN_STEP = 60; // pixels
const TURN_STEP = Math.PI / 12;
const WHEEL = 0.0015;
const RIM = 4; // pixels
const FONT = "600 13px system-ui, sans-serif";
const REST_PX = 8; // a finger that moves less is a press, and does not move the map
const REACH_PX = 22; // half the size of a target for a finger
const PRIMARY = 1; // in `buttons`: the main button alone
const LETTER_PX = 3; // half the width of a letter of a name

/** Return the pixels at the sides of the canvas that controls cover: its style sheet names them. */
export function coveredOf(canvas) {
  const { scrollPaddingLeft, scrollPaddingRight, scrollPaddingTop, scrollPaddingBottom } =
    getComputedStyle(canvas);
  const [left, right, above, below] = [
    scrollPaddingLeft,
    scrollPaddingRight,
    scrollPaddingTop,
    scrollPaddingBottom,
  ].map((length) => Number.parseFloat(length) || 0); // `auto` covers nothing
  return { left, right, above, below };
}

/**
 * Events: "choose" (detail: {x, y, heading}); "pick", on a press while `chooses` is false (detail: {place} or
 * {robot}, as they were given; {point: {x, y}} elsewhere; {} on the ghost); "turn" (detail: the ghost with another
 * heading).
 */
export class MapView extends EventTarget {
  #element;
  #canvas;
  #map = null;
  #picture = null;
  #frame = null; // null: the whole map
  #robot = null;
  #robots = []; // of a fleet, with their names
  #scan = [];
  #path = [];
  #places = [];
  #goal = null;
  #footprint = [];
  #ghost = null; // pose of the robot where a person pressed
  #turns = false; // a finger turns the ghost
  #chooses = false;
  #chosen = null; // point and heading that are being chosen
  #heading = 0; // of a point that is chosen by keys
  #pointers = new Map();
  #from = null; // pixel where the choice began
  #pressedAt = null; // pixel of a finger that has not moved yet
  #grip = { lose: () => this.#drop() }; // a finger that chooses
  #listening = new AbortController();

  /** @param {HTMLCanvasElement} element its colours are custom properties named --view-... */
  constructor(element) {
    super();
    this.#element = element;
    this.#canvas = new Canvas(element, "--view-", COLOURS, (pen, width, height) =>
      this.#draw(pen, width, height),
    );
    const { signal } = this.#listening;
    const on = (type, act, options = {}) =>
      element.addEventListener(type, act, { signal, ...options });
    on("wheel", (event) => this.#rolled(event), { passive: false });
    on("pointerdown", (event) => this.#pressed(event));
    on("pointermove", (event) => this.#dragged(event));
    on("pointerup", (event) => this.#released(event));
    // Pick on the click, not when the finger lifts: else an element that appears under the finger gets the
    // click.
    on("click", () => this.#clicked());
    on("pointercancel", (event) => this.#dropped(event));
    on(
      "lostpointercapture",
      (event) => this.#pointers.has(event.pointerId) && this.#dropped(event),
    );
    on("keydown", (event) => this.#typed(event));
  }

  /** @param {?object} map as the API describes it @param {?CanvasImageSource} picture */
  show(map, picture) {
    this.#map = map;
    this.#picture = picture;
    this.#canvas.redraw();
  }

  /** @param {{state: object, scan: ?object}} view of the robot */
  set view({ state, scan }) {
    this.#robot = state.location ?? null;
    this.#goal = state.going ?? null;
    this.#scan = scan?.laser_cm ?? [];
    this.#canvas.redraw();
  }

  /** @param {number[][]} footprint of the robot, for its ghost */
  set footprint(footprint) {
    this.#footprint = footprint;
  }

  /** @param {?{x: number, y: number, heading: number}} ghost the robot where a person wants it */
  set ghost(ghost) {
    this.#ghost = ghost;
    this.#canvas.redraw();
  }

  /** Return the heading from the robot to a point. */
  headingTo({ x, y }) {
    return this.#robot ? Math.atan2(y - this.#robot.y, x - this.#robot.x) : 0;
  }

  /** @param {{name: string, location: object, going: ?object}[]} robots of a fleet */
  set robots(robots) {
    this.#robots = robots;
    this.#canvas.redraw();
  }

  /** @param {number[]} path flat x, y in centimetres */
  set path(path) {
    this.#path = path;
    this.#canvas.redraw();
  }

  /** @param {{name: string, x: number, y: number, heading: number}[]} places */
  set places(places) {
    this.#places = places;
    this.#canvas.redraw();
  }

  /** Whether a press chooses a point; if not, a drag moves the map. */
  set chooses(chooses) {
    this.#chooses = chooses;
    this.#forget();
    this.#heading = this.#robot?.heading ?? 0;
    this.#canvas.redraw();
  }

  zoom(factor, pixel = this.#middle) {
    this.#frame = zoomed(this.#seen, factor, pixel, ...this.#size, this.#coarsest);
    this.#canvas.redraw();
  }

  fit() {
    this.#frame = null;
    this.#canvas.redraw();
  }

  close() {
    this.#forget();
    this.#listening.abort();
    this.#canvas.close();
  }

  get #size() {
    return [this.#element.clientWidth, this.#element.clientHeight];
  }

  get #middle() {
    return this.#size.map((side) => side / 2);
  }

  get #seen() {
    return this.#frame ?? this.#whole;
  }

  /** Pixels per metre of the coarsest scale: with it, the whole map fills the view. */
  get #coarsest() {
    return this.#map ? this.#whole.scale : 2;
  }

  get #whole() {
    if (this.#map) return whole(corners(this.#map), ...this.#size, coveredOf(this.#element));
    return { x: this.#robot?.x ?? 0, y: this.#robot?.y ?? 0, scale: 40 };
  }

  // --- pointers and keys -------------------------------------------------------------------------

  #pixel({ clientX, clientY }) {
    const { left, top } = this.#element.getBoundingClientRect();
    return [clientX - left, clientY - top];
  }

  #rolled(event) {
    event.preventDefault();
    this.zoom(Math.exp(-event.deltaY * WHEEL), this.#pixel(event));
  }

  #pressed(event) {
    if (event.button !== 0 || event.buttons !== PRIMARY) return; // a press for the menu chooses no point
    this.#element.setPointerCapture?.(event.pointerId);
    this.#pointers.set(event.pointerId, this.#pixel(event));
    this.#pressedAt = !this.#chooses && this.#pointers.size === 1 ? this.#pixel(event) : null;
    this.#turns = this.#pressedAt !== null && this.#isOnGhost(this.#pressedAt);
    if (this.#chooses && this.#pointers.size === 1) {
      this.#from = this.#pixel(event);
      this.#choose(this.#from);
      hand.begin(this.#grip, Infinity); // a finger that rests sends nothing to the robot
    } else {
      this.#forget(); // a second finger zooms
    }
  }

  #dragged(event) {
    const before = this.#pointers.get(event.pointerId);
    if (!before) return;
    if (event.buttons !== PRIMARY) return this.#dropped(event); // the page did not hear of the release
    const now = this.#pixel(event);
    if (this.#pressedAt && apart(now, this.#pressedAt) < REST_PX) return;
    this.#pressedAt = null;
    if (this.#from) {
      this.#choose(now);
    } else if (this.#turns && this.#pointers.size === 1) {
      this.#turn(now);
    } else {
      const others = [...this.#pointers].filter(([id]) => id !== event.pointerId);
      if (others.length) this.#pinch(before, now, others[0][1]);
      else this.#frame = panned(this.#seen, now[0] - before[0], now[1] - before[1]);
    }
    this.#pointers.set(event.pointerId, now);
    this.#canvas.redraw();
  }

  #pinch(before, now, other) {
    const width = (one) => Math.max(apart(one, other), 1);
    const moved = panned(this.#seen, (now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
    const between = [(now[0] + other[0]) / 2, (now[1] + other[1]) / 2];
    const factor = width(now) / width(before);
    this.#frame = zoomed(moved, factor, between, ...this.#size, this.#coarsest);
  }

  #isOnGhost(pixel) {
    if (!this.#ghost) return false;
    const { x, y } = this.#ghost;
    const least = robotSize(this.#seen.scale) * this.#seen.scale;
    return apart(pixel, toPixels(this.#seen, [x, y], ...this.#size)) < Math.max(REACH_PX, least);
  }

  #turn(pixel) {
    const { x, y, heading } = this.#ghost;
    const from = toPixels(this.#seen, [x, y], ...this.#size);
    const detail = { ...this.#ghost, heading: headingOf(from, pixel, heading) };
    this.dispatchEvent(new CustomEvent("turn", { detail }));
  }

  #choose(pixel) {
    const [x, y] = toPoint(this.#seen, this.#from, ...this.#size);
    const heading = headingOf(this.#from, pixel, null);
    this.#chosen = {
      x,
      y,
      heading: heading ?? this.headingTo({ x, y }),
      isTurned: heading !== null,
    };
    this.#canvas.redraw();
  }

  #released(event) {
    this.#pointers.delete(event.pointerId);
    if (this.#from) this.#send();
  }

  #clicked() {
    if (this.#pressedAt) this.#pick(this.#pressedAt);
    this.#pressedAt = null;
  }

  /** Pick the nearest robot or place whose mark or name is under the finger; robots first: they are above. */
  #pick([left, top]) {
    const near = (spots) => {
      const ways = spots.map(({ name, x, y }) => {
        const [spotLeft, spotTop] = toPixels(this.#seen, [x, y], ...this.#size);
        const beside = Math.max(Math.abs(left - spotLeft) - LETTER_PX * name.length, 0);
        return Math.hypot(beside, top - spotTop);
      });
      const least = Math.min(...ways);
      return least <= REACH_PX ? ways.indexOf(least) : -1;
    };
    const spots = this.#robots.map(({ name, location: { x, y } }) => ({ name, x, y }));
    const robot = this.#robots[near(spots)];
    const place = this.#places[near(this.#places)];
    this.dispatchEvent(
      new CustomEvent("pick", { detail: this.#pickedOf(robot, place, [left, top]) }),
    );
  }

  #pickedOf(robot, place, pixel) {
    if (robot) return { robot };
    if (place) return { place };
    if (this.#isOnGhost(pixel)) return {};
    const [x, y] = toPoint(this.#seen, pixel, ...this.#size);
    return { point: { x, y } };
  }

  #dropped(event) {
    this.#pointers.delete(event.pointerId);
    this.#pressedAt = null;
    this.#forget();
    this.#canvas.redraw();
  }

  /** The hand may be gone: choose nothing. */
  #drop() {
    this.#pointers.clear();
    this.#forget();
    this.#canvas.redraw();
  }

  #forget() {
    hand.end(this.#grip);
    this.#from = this.#chosen = null;
  }

  #send() {
    const detail = this.#chosen;
    this.#forget();
    this.#canvas.redraw();
    if (detail) this.dispatchEvent(new CustomEvent("choose", { detail }));
  }

  /** While the map has the focus, arrow keys move the map and do not drive the robot. */
  #typed(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const act = this.#keys[event.key];
    if (!act?.()) return;
    event.preventDefault();
    event.stopPropagation();
    this.#canvas.redraw();
  }

  get #keys() {
    const pan = (dx, dy) => () => {
      this.#frame = panned(this.#seen, dx * PAN_STEP, dy * PAN_STEP);
      return true;
    };
    const turn = (step) => () => {
      if (this.#chooses) this.#heading += step;
      return this.#chooses;
    };
    const zoom = (factor) => () => {
      this.zoom(factor);
      return true;
    };
    return {
      ArrowUp: pan(0, 1),
      ArrowDown: pan(0, -1),
      ArrowLeft: pan(1, 0),
      ArrowRight: pan(-1, 0),
      "+": zoom(ZOOM_STEP),
      "-": zoom(1 / ZOOM_STEP),
      0: () => {
        this.fit();
        return true;
      },
      ",": turn(TURN_STEP),
      ".": turn(-TURN_STEP),
      Enter: () => {
        if (!this.#chooses) return false;
        this.#chosen = this.#middlePoint;
        this.#send();
        return true;
      },
    };
  }

  get #middlePoint() {
    const [x, y] = toPoint(this.#seen, this.#middle, ...this.#size);
    const heading = Math.atan2(Math.sin(this.#heading), Math.cos(this.#heading));
    return { x, y, heading, isTurned: true };
  }

  // --- the picture -------------------------------------------------------------------------------

  #draw(pen, width, height) {
    const { density, colour } = this.#canvas;
    const frame = this.#seen;
    const pixels = frame.scale * density;
    const [x, y] = toPixels({ ...frame, scale: pixels }, [0, 0], width, height);
    pen.setTransform(pixels, 0, 0, -pixels, x, y); // metres, y up
    const brush = { pen, colour, pixel: density / pixels };
    if (this.#map && this.#picture) drawPicture(brush, this.#map, this.#picture);
    drawPath(brush, this.#path, 2.5);
    if (this.#goal) drawGoal(brush, this.#goal, colour.path);
    if (this.#robot) drawLaser(brush, this.#robot, this.#scan);
    for (const place of this.#places) drawPlace(brush, place);
    if (this.#robot) drawRobot(brush, this.#robot);
    for (const robot of this.#robots) this.#drawOneOfMany(brush, robot);
    if (this.#ghost) drawGhost(brush, this.#ghost, this.#footprint, this.#robot);
    this.#drawNames(brush);
    if (this.#chosen) drawGoal(brush, this.#chosen, colour.hold);
    else if (this.#chooses && document.activeElement === this.#element)
      drawGoal(brush, this.#middlePoint, colour.hold);
  }

  /** Draw a robot of a fleet and a straight line to its goal: only its own page gets the path. */
  #drawOneOfMany(brush, { location, going }) {
    const { pen, colour, pixel } = brush;
    if (going) {
      pen.setLineDash([6 * pixel, 5 * pixel]);
      const line = [location.x, location.y, going.x, going.y].map((metres) => 100 * metres);
      drawPath(brush, line, 2);
      pen.setLineDash([]);
      drawGoal(brush, going, colour.path);
    }
    drawRobot(brush, location);
  }

  /** Write the names of robots and places where they cover no robot, no goal and no other name. */
  #drawNames({ pen, colour, pixel }) {
    const [width, height] = this.#size;
    pen.save();
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.scale(this.#canvas.density, this.#canvas.density);
    pen.font = FONT;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.lineJoin = "round";
    pen.lineWidth = RIM;
    pen.strokeStyle = colour.surface;
    const at = ({ x, y }) => {
      const [left, top] = toPixels(this.#seen, [x, y], width, height);
      return { left, top };
    };
    const robots = this.#robots.map(({ name, location, moves_although_stopped: moves }) => ({
      text: name,
      ...at(location),
      ink: moves ? colour.alarm : colour.laser,
    }));
    const places = this.#places.map((place) => ({
      text: place.name,
      ...at(place),
      ink: colour.place,
    }));
    const labels = [...robots, ...places]
      .filter(({ left }) => left >= 0 && left <= width)
      .map((label) => ({ ...label, half: pen.measureText(label.text).width / 2 + RIM }));
    const radius = robotSize(1 / pixel) / pixel;
    const poses = [this.#robot, this.#ghost, ...this.#robots.map(({ location }) => location)];
    const goals = [this.#goal, ...this.#robots.map(({ going }) => going)];
    const marks = [
      ...poses.filter(Boolean).map((pose) => ({ ...at(pose), radius })),
      ...goals.filter(Boolean).map((goal) => ({ ...at(goal), radius: GOAL_PX })),
    ];
    placed(labels, marks, width).forEach(({ left, top }, i) => {
      pen.fillStyle = labels[i].ink;
      pen.strokeText(labels[i].text, left, top);
      pen.fillText(labels[i].text, left, top);
    });
    pen.restore();
  }
}

/** Return the distance of two points, in pixels. */
function apart(one, other) {
  return Math.hypot(one[0] - other[0], one[1] - other[1]);
}
