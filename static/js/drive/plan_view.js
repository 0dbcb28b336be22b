/**
 * The robot from above: what its sensors see, its footprint, its path and the obstacle for which the gate
 * slows it. Forward is up. Drawn when something has changed, at most once per frame.
 */

import { KeyPointer } from "../going/key_pointer.js";
import { Canvas } from "../lib/canvas.js";
import { arc, carried, moves, reach, spanFor } from "./twist_geometry.js";

const PATH_S = 2;
const PATH_STEPS = 24;
const ROBOT_AT = 0.6; // share of the height: the view shows more ahead than behind
const COARSEST = 36; // least page pixels per metre: a small picture shows less of the room, not a tiny robot
const STALE_ALPHA = 0.5; // pale, but walls and robot can still be told apart in the dark
const HALF_TEXT = 16; // page pixels
const UNSEEN_M = 1.5; // distance to which unseen sectors are shaded: the robot can be there soon

const COLOURS = [
  "surface",
  "grid",
  "grid-text",
  "laser",
  "depth",
  "remembered",
  "sonar",
  "unseen",
  "robot",
  "robot-edge",
  "arm",
  "path",
  "path-body",
  "hold",
  "alarm",
];

function away([x, y]) {
  return Math.hypot(x, y);
}

function middleOf(outline) {
  return [0, 1].map(
    (axis) => outline.reduce((sum, corner) => sum + corner[axis], 0) / outline.length,
  );
}

export class PlanView {
  static hears = ["facts", "view", "stale", "ghost"];
  #element;
  #canvas;
  #keys;
  #facts = null;
  #view = null;
  #stale = false;
  #ghost = null;
  #span = 3;
  #listening = new AbortController();

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ parts, tell }) {
    this.#element = parts.picture;
    const { signal } = this.#listening;
    const point = (event) => tell({ pointed: { point: this.#pointAt(this.#spotOf(event)) } });
    this.#element.addEventListener("click", point, { signal });
    this.#keys = new KeyPointer(this.#element, parts["point-words"], {
      begins: [0.5, ROBOT_AT / 2],
      pointAt: (spot) => this.#pointAt(spot),
      choose: (there) => tell({ pointed: { point: there, from: this.#element } }),
    });
    this.#canvas = new Canvas(parts.picture, "--view-", COLOURS, (pen, width, height) =>
      this.#draw(pen, width, height),
    );
  }

  set facts(facts) {
    this.#facts = facts;
    this.#canvas.redraw();
  }

  set view(view) {
    this.#view = view;
    if (view?.scan) this.#span = spanFor(view.scan.laser_cm, this.#span);
    this.#canvas.redraw();
  }

  /** Whether the view is out of date: then it is drawn pale. */
  set stale(stale) {
    if (stale === this.#stale) return;
    this.#stale = stale;
    this.#canvas.redraw();
  }

  /** @param {?import("../going/way.js").Way} ghost the robot where a person pressed, and the way there */
  set ghost(ghost) {
    this.#ghost = ghost;
    this.#canvas.redraw();
  }

  close() {
    this.#listening.abort();
    this.#keys.close();
    this.#canvas.close();
  }

  /** Pixels per metre; the sizes are in the same pixels, `density` of them in one of the page. */
  #scale(width, height, density) {
    return Math.max(Math.min(width / 2, height * ROBOT_AT) / this.#span, COARSEST * density);
  }

  #spotOf({ clientX, clientY }) {
    const { left, top } = this.#element.getBoundingClientRect();
    return [clientX - left, clientY - top];
  }

  /** Return the point at a spot of the picture (page pixels), in the base frame. */
  #pointAt([right, down]) {
    const { width, height } = this.#element.getBoundingClientRect();
    const scale = this.#scale(width, height, 1);
    return [(height * ROBOT_AT - down) / scale, (width / 2 - right) / scale];
  }

  #draw(pen, width, height) {
    const { density } = this.#canvas;
    const pixels = this.#scale(width, height, density);
    // From here on: metres, x forward is up, y left is left.
    pen.setTransform(0, -pixels, -pixels, 0, width / 2, height * ROBOT_AT);
    const pixel = density / pixels;
    this.#drawGrid(pixel, (width / 2 / density - HALF_TEXT) / (pixels / density));
    if (!this.#facts || !this.#view) return;
    pen.globalAlpha = this.#stale ? STALE_ALPHA : 1;
    this.#drawUnseen(this.#view.scan?.unseen ?? []);
    this.#drawSonars(this.#view.scan?.sonar_cm ?? [], pixel);
    this.#drawPath(this.#view.state.verdict.allowed, pixel);
    const { laser_cm = [], depth_cm = [], remembered_cm = [] } = this.#view.scan ?? {};
    const grain = Math.max(2.5 * pixel, 0.06); // metres: points on a grid of this size are drawn without gaps
    this.#drawPoints(remembered_cm, "remembered", grain);
    this.#drawPoints(depth_cm, "depth", grain);
    this.#drawPoints(laser_cm, "laser", 3 * pixel);
    this.#drawRobot(pixel);
    if (this.#ghost) this.#drawGhost(this.#ghost, pixel);
    this.#drawHold(this.#view.state.verdict.point, pixel);
  }

  /** @param {number} mostM no text stands farther aside: the edge would cut it */
  #drawGrid(pixel, mostM) {
    const pen = this.#canvas.pen;
    pen.strokeStyle = this.#canvas.colour.grid;
    pen.lineWidth = pixel;
    for (let metres = 1; metres <= 10; metres += 1) {
      pen.beginPath();
      pen.arc(0, 0, metres, 0, 2 * Math.PI);
      pen.stroke();
      if (metres < mostM) this.#write(`${metres} m`, 0, -metres, pixel);
    }
  }

  /** Draw upright text, although the axes are rotated. */
  #write(text, x, y, pixel) {
    const pen = this.#canvas.pen;
    pen.save();
    pen.translate(x, y);
    pen.transform(0, -pixel, -pixel, 0, 0, 0);
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    const half = pen.measureText(text).width / 2 + 3;
    pen.fillStyle = this.#canvas.colour.surface;
    pen.fillRect(-half, -7, 2 * half, 14);
    pen.fillStyle = this.#canvas.colour["grid-text"];
    pen.fillText(text, 0, 0);
    pen.restore();
  }

  #drawUnseen(sectors) {
    const pen = this.#canvas.pen;
    pen.fillStyle = this.#canvas.colour.unseen;
    for (const [from, to] of sectors) {
      pen.beginPath();
      pen.moveTo(0, 0);
      pen.arc(0, 0, UNSEEN_M, from, to);
      pen.closePath();
      pen.fill();
    }
  }

  #drawSonars(rangesCm, pixel) {
    const pen = this.#canvas.pen;
    this.#facts.sonars.forEach(({ x, y, yaw, fov }, i) => {
      const range = rangesCm[i];
      if (range === null || range === undefined) return;
      pen.beginPath();
      pen.moveTo(x, y);
      pen.arc(x, y, range / 100, yaw - fov / 2, yaw + fov / 2);
      pen.closePath();
      pen.fillStyle = this.#canvas.colour.sonar;
      pen.fill();
      pen.beginPath();
      pen.arc(x, y, range / 100, yaw - fov / 2, yaw + fov / 2);
      pen.strokeStyle = this.#canvas.colour.laser;
      pen.lineWidth = 2 * pixel;
      pen.stroke();
    });
  }

  #drawPoints(flatCm, colour, size) {
    const pen = this.#canvas.pen;
    pen.fillStyle = this.#canvas.colour[colour];
    for (let i = 0; i < flatCm.length; i += 2) {
      pen.fillRect(flatCm[i] / 100 - size / 2, flatCm[i + 1] / 100 - size / 2, size, size);
    }
  }

  #drawPath(allowed, pixel) {
    if (!moves(allowed)) return;
    const pen = this.#canvas.pen;
    const [vx, vy, w] = allowed;
    const poses = arc({ vx, vy, w }, PATH_S, PATH_STEPS);
    pen.lineCap = "round";
    pen.lineJoin = "round";
    const trace = () => {
      pen.beginPath();
      pen.moveTo(0, 0);
      for (const { x, y } of poses) pen.lineTo(x, y);
    };
    trace();
    pen.strokeStyle = this.#canvas.colour["path-body"];
    pen.lineWidth = 2 * reach(this.#facts.footprint);
    pen.stroke();
    trace();
    pen.strokeStyle = this.#canvas.colour.path;
    pen.lineWidth = 3 * pixel;
    pen.stroke();
    pen.setLineDash([5 * pixel, 5 * pixel]);
    pen.lineWidth = 1.5 * pixel;
    this.#outline(carried(this.#facts.footprint, poses.at(-1)));
    pen.stroke();
    pen.setLineDash([]);
  }

  #drawGhost({ ghost, nose, floor, problem }, pixel) {
    const { pen, colour } = this.#canvas;
    const strength = pen.globalAlpha;
    pen.fillStyle = pen.strokeStyle = problem ? colour.alarm : colour.path;
    pen.lineWidth = 2 * pixel;
    pen.globalAlpha = 0.12 * strength;
    for (const outline of [floor, ghost]) {
      this.#outline(outline);
      pen.fill();
    }
    pen.globalAlpha = strength;
    pen.setLineDash([6 * pixel, 4 * pixel]);
    pen.stroke();
    pen.setLineDash([]);
    this.#outline([middleOf(ghost), nose]);
    pen.stroke();
  }

  #drawRobot(pixel) {
    const pen = this.#canvas.pen;
    this.#drawArm(this.#view.state.arm ?? [], pixel);
    this.#outline(this.#facts.footprint);
    pen.fillStyle = this.#canvas.colour.robot;
    pen.fill();
    pen.strokeStyle = this.#canvas.colour["robot-edge"];
    pen.lineWidth = 2 * pixel;
    pen.stroke();
    const nose = Math.max(...this.#facts.footprint.map(([x]) => x));
    pen.beginPath();
    pen.moveTo(nose * 0.72, 0);
    pen.lineTo(nose * 0.2, nose * 0.32);
    pen.lineTo(nose * 0.2, -nose * 0.32);
    pen.closePath();
    pen.fillStyle = this.#canvas.colour["robot-edge"];
    pen.fill();
  }

  /** Draw the arm from the body to its end, as wide as the gate counts it, with its name at the end. */
  #drawArm(discs, pixel) {
    if (discs.length === 0) return;
    const pen = this.#canvas.pen;
    const radius = discs[0][2];
    pen.lineCap = "round";
    pen.lineJoin = "round";
    for (const [colour, width] of [
      ["robot-edge", 2 * radius],
      ["arm", 2 * radius - 4 * pixel],
    ]) {
      pen.beginPath();
      pen.moveTo(0, 0);
      for (const [x, y] of discs) pen.lineTo(x, y);
      pen.strokeStyle = this.#canvas.colour[colour];
      pen.lineWidth = Math.max(width, pixel);
      pen.stroke();
    }
    const [x, y] = discs.reduce((far, disc) => (away(disc) > away(far) ? disc : far));
    const beyond = 1 + (radius + 12 * pixel) / away([x, y]);
    this.#write(gettext("arm"), x * beyond, y * beyond, pixel);
  }

  #drawHold(point, pixel) {
    if (!point) return;
    const pen = this.#canvas.pen;
    const [x, y] = point;
    const distance = Math.hypot(x, y) || 1;
    const hull = reach(this.#facts.footprint);
    pen.strokeStyle = this.#canvas.colour.hold;
    pen.lineWidth = 2 * pixel;
    pen.beginPath();
    pen.moveTo((x / distance) * hull, (y / distance) * hull);
    pen.lineTo(x, y);
    pen.stroke();
    pen.lineWidth = 3 * pixel;
    pen.beginPath();
    pen.arc(x, y, 9 * pixel, 0, 2 * Math.PI);
    pen.stroke();
    pen.beginPath();
    pen.arc(x, y, 3 * pixel, 0, 2 * Math.PI);
    pen.fillStyle = this.#canvas.colour.hold;
    pen.fill();
  }

  #outline(points) {
    const pen = this.#canvas.pen;
    pen.beginPath();
    for (const [x, y] of points) pen.lineTo(x, y); // the first call draws no line: the path is empty
    pen.closePath();
  }
}
