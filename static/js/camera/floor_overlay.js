/** Draws the robot's path over a camera's picture, and hints at the edges to near obstacles outside it. */

import { withArm } from "../drive/twist_geometry.js";
import { Canvas } from "../lib/canvas.js";
import { edgeHints, floorPath, inPicture } from "./floor_geometry.js";
import { covering } from "./frame.js";

const TIERS = ["green", "yellow", "red"];
const NEAR_M = 0.4; // at this distance or less, a hint is fully opaque
const FAR_M = 1.5;
const FAINT = 0.35;
const WEDGE = 18; // pixels of the page, from edge to tip

export class FloorOverlay {
  #canvas;
  #facts = null;
  #path = null; // of the newest view
  #hold = null; // the obstacle for which the gate slows the robot: x, y
  #near = []; // obstacles that get a hint if the picture does not show them
  #ghost = null;
  #header = null;

  /**
   * @param {HTMLCanvasElement} canvas as large as the picture's; its colours are custom properties named
   *   --floor-...
   */
  constructor(canvas) {
    this.#canvas = new Canvas(canvas, "--floor-", [...TIERS, "edge"], (pen, width, height) =>
      this.#draw(pen, width, height),
    );
  }

  set facts(facts) {
    this.#facts = facts;
    this.#canvas.redraw();
  }

  /** @param {?object} view the robot's newest view; null: it is too old to draw */
  set view(view) {
    this.#path = null;
    this.#hold = view?.state.verdict.point ?? null;
    const { laser_cm = [], remembered_cm = [], depth_cm = [] } = view?.scan ?? {};
    this.#near = [...laser_cm, ...remembered_cm];
    if (view && this.#facts) {
      const known = [...this.#near, ...depth_cm];
      const { arm = [], verdict } = view.state;
      this.#path = floorPath(withArm(this.#facts.footprint, arm), verdict, known, this.#facts);
    }
    this.#canvas.redraw();
  }

  /** @param {?import("../going/way.js").Way} ghost the robot where a person pressed, and the way there */
  set ghost(ghost) {
    this.#ghost = ghost;
    this.#canvas.redraw();
  }

  /** @param {?object} header of the picture that is shown; nothing is drawn without its lens and pose */
  set header(header) {
    this.#header = header?.lens && header.pose ? header : null;
    this.#canvas.redraw();
  }

  close() {
    this.#canvas.close();
  }

  #draw(pen, width, height) {
    const header = this.#header;
    if (!header || !this.#path) return;
    const { scale, x, y } = covering(header, width, height);
    const pixel = this.#canvas.density / scale; // size of one page pixel, in pixels of the picture
    pen.setTransform(scale, 0, 0, scale, x, y);
    pen.save();
    pen.beginPath();
    pen.rect(0, 0, header.width, header.height);
    pen.clip();
    this.#drawPath(header, pixel);
    if (this.#ghost) this.#drawGhost(header, pixel);
    this.#drawHints(header, pixel);
    this.#drawHold(header, pixel);
    pen.restore();
  }

  #drawPath(header, pixel) {
    const pen = this.#canvas.pen;
    const { bands, stop, later } = this.#path;
    pen.lineJoin = "round";
    for (const { tier, outline } of bands) {
      if (!this.#trace(inPicture(outline, header))) continue;
      pen.fillStyle = this.#canvas.colour[tier];
      pen.globalAlpha = 0.35;
      pen.fill();
      pen.globalAlpha = 0.9;
      pen.lineWidth = 2 * pixel;
      pen.strokeStyle = this.#canvas.colour[tier];
      pen.stroke();
    }
    pen.globalAlpha = 1;
    if (later && this.#trace(inPicture(later, header))) {
      pen.setLineDash([6 * pixel, 5 * pixel]);
      pen.strokeStyle = this.#canvas.colour.edge;
      pen.stroke();
      pen.setLineDash([]);
    }
    if (stop && this.#trace(inPicture(stop, header))) {
      pen.lineWidth = 6 * pixel;
      pen.strokeStyle = this.#canvas.colour.red;
      pen.stroke();
    }
  }

  #drawGhost(header, pixel) {
    const { pen, colour } = this.#canvas;
    const { ghost, nose, floor, problem } = this.#ghost;
    const ink = problem ? colour.red : colour.green;
    pen.fillStyle = ink;
    pen.globalAlpha = 0.2;
    if (this.#trace(inPicture(floor, header))) pen.fill();
    pen.globalAlpha = 0.35;
    const isSeen = this.#trace(inPicture(ghost, header));
    if (isSeen) pen.fill();
    pen.globalAlpha = 1;
    if (!isSeen) return;
    for (const [stroke, width] of [
      [colour.edge, 5],
      [ink, 3],
    ]) {
      pen.strokeStyle = stroke;
      pen.lineWidth = width * pixel;
      pen.stroke();
    }
    const [tip] = inPicture([nose], header);
    if (!tip) return;
    pen.fillStyle = colour.edge;
    pen.beginPath();
    pen.arc(...tip, 5 * pixel, 0, 2 * Math.PI);
    pen.fill();
  }

  /** Mark the very spot, as the plan does. */
  #drawHold(header, pixel) {
    const [spot] = this.#hold ? inPicture([this.#hold], header) : [];
    if (!spot) return;
    const pen = this.#canvas.pen;
    for (const [colour, width] of [
      ["edge", 7],
      ["red", 4],
    ]) {
      pen.beginPath();
      pen.arc(...spot, 13 * pixel, 0, 2 * Math.PI);
      pen.lineWidth = width * pixel;
      pen.strokeStyle = this.#canvas.colour[colour];
      pen.stroke();
    }
  }

  #drawHints(header, pixel) {
    const pen = this.#canvas.pen;
    const { width, height } = header;
    const size = WEDGE * pixel;
    pen.fillStyle = this.#canvas.colour.red;
    pen.strokeStyle = this.#canvas.colour.edge;
    pen.lineWidth = pixel;
    for (const { edge, at, distanceM } of edgeHints(this.#near, header)) {
      const strength = Math.min(1, Math.max(0, (FAR_M - distanceM) / (FAR_M - NEAR_M)));
      pen.globalAlpha = FAINT + (1 - FAINT) * strength;
      if (edge === "bottom") this.#wedge([at * width, height], [0, -size], [size, 0]);
      else if (edge === "left") this.#wedge([0, at * height], [size, 0], [0, size]);
      else this.#wedge([width, at * height], [-size, 0], [0, size]);
    }
    pen.globalAlpha = 1;
  }

  /** Draw a triangle on an edge, which points inwards. */
  #wedge([x, y], [tipX, tipY], [sideX, sideY]) {
    this.#trace([
      [x - sideX, y - sideY],
      [x + tipX, y + tipY],
      [x + sideX, y + sideY],
    ]);
    this.#canvas.pen.fill();
    this.#canvas.pen.stroke();
  }

  /** Begin a path through points. @returns {boolean} whether there is anything to paint */
  #trace(points) {
    this.#canvas.pen.beginPath();
    // The first call draws no line: the path is empty.
    for (const [x, y] of points) this.#canvas.pen.lineTo(x, y);
    this.#canvas.pen.closePath();
    return points.length > 1;
  }
}
