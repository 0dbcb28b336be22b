/**
 * Draws the parts of a map view: the map's picture, paths, laser points, robots, goals and places. The pen's unit is
 * the metre, with y up. `pixel` is the size of a pixel of the page in metres: symbols keep their size at each
 * zoom.
 *
 * @typedef {{pen: CanvasRenderingContext2D, colour: Record<string, string>, pixel: number}} Brush
 */

import { carried } from "../drive/twist_geometry.js";
import { onMap } from "./map_frame.js";

export const GOAL_PX = 11; // radius of a goal's outer ring

/** @param {Brush} brush @param {object} map as the API describes it @param {CanvasImageSource} picture */
export function drawPicture({ pen }, map, picture) {
  const { origin_x_m: x, origin_y_m: y, origin_rad: yaw, resolution_m: side } = map;
  pen.save();
  pen.translate(x, y);
  pen.rotate(yaw);
  pen.scale(1, -1);
  pen.imageSmoothingEnabled = false;
  const [w, h] = [map.width * side, map.height * side];
  pen.drawImage(picture, 0, -h, w, h);
  pen.restore();
}

/**
 * @param {Brush} brush
 * @param {number[]} flatCm points [x0, y0, x1, y1, ...], centimetres
 * @param {number} width in pixels
 */
export function drawPath({ pen, colour, pixel }, flatCm, width) {
  if (flatCm.length < 4) return;
  pen.beginPath();
  for (let i = 0; i < flatCm.length; i += 2) pen.lineTo(flatCm[i] / 100, flatCm[i + 1] / 100);
  pen.strokeStyle = colour.path;
  pen.lineWidth = width * pixel;
  pen.stroke();
}

/**
 * @param {Brush} brush
 * @param {object} robot its pose
 * @param {number[]} flatCm points [x0, y0, x1, y1, ...] in the robot's frame, centimetres
 */
export function drawLaser({ pen, colour, pixel }, robot, flatCm) {
  pen.fillStyle = colour.laser;
  const side = 2.5 * pixel;
  for (let i = 0; i < flatCm.length; i += 2) {
    const [x, y] = onMap(robot, [flatCm[i], flatCm[i + 1]]);
    pen.fillRect(x - side / 2, y - side / 2, side, side);
  }
}

/** Draw a robot with its heading, and the ellipse of two standard deviations. */
export function drawRobot(brush, robot) {
  const { pen, colour, pixel } = brush;
  pen.beginPath();
  pen.ellipse(
    robot.x,
    robot.y,
    Math.max(2 * robot.sigma_m, 2 * pixel),
    Math.max(2 * robot.sigma_across_m, 2 * pixel),
    robot.ellipse_rad,
    0,
    2 * Math.PI,
  );
  pen.fillStyle = colour["path-body"];
  pen.strokeStyle = robot.problem ? colour.hold : colour["robot-edge"];
  pen.lineWidth = pixel;
  pen.fill();
  pen.stroke();
  drawArrow(brush, robot);
}

/** Return the radius of a robot's symbol (m) at this scale (pixels per metre). */
export function robotSize(scale) {
  return Math.max(0.27, 9 / scale);
}

/**
 * Draw the robot where a person wants it, and a straight line from where it stands: navigation plans its way later.
 * @param {Brush} brush
 * @param {{x: number, y: number, heading: number}} ghost
 * @param {number[][]} footprint
 * @param {?{x: number, y: number}} robot null: nobody knows where it is
 */
export function drawGhost({ pen, colour, pixel }, ghost, footprint, robot) {
  const { x, y, heading } = ghost;
  pen.save();
  pen.strokeStyle = pen.fillStyle = colour.path;
  pen.lineWidth = 2 * pixel;
  pen.setLineDash([6 * pixel, 5 * pixel]);
  pen.beginPath();
  if (robot) pen.moveTo(robot.x, robot.y);
  pen.lineTo(x, y);
  pen.stroke();
  pen.beginPath();
  for (const corner of carried(footprint, { x, y, yaw: heading })) pen.lineTo(...corner);
  pen.closePath();
  pen.stroke();
  pen.fillStyle = colour["path-body"];
  pen.fill();
  pen.setLineDash([]);
  pen.translate(x, y);
  pen.rotate(heading);
  pen.fillStyle = colour.path;
  const size = robotSize(1 / pixel);
  pen.beginPath();
  pen.moveTo(0, 0);
  pen.lineTo(1.6 * size, 0);
  pen.stroke();
  pen.beginPath();
  pen.arc(1.6 * size, 0, 5 * pixel, 0, 2 * Math.PI); // the handle that turns it
  pen.fill();
  pen.restore();
}

/** Draw a ring around a triangle that shows the heading. */
function drawArrow({ pen, colour, pixel }, { x, y, heading }) {
  const size = robotSize(1 / pixel);
  pen.save();
  pen.translate(x, y);
  pen.rotate(heading);
  pen.strokeStyle = pen.fillStyle = colour["robot-edge"];
  pen.lineWidth = 2 * pixel;
  pen.beginPath();
  pen.arc(0, 0, size, 0, 2 * Math.PI);
  pen.stroke();
  pen.beginPath();
  pen.moveTo(size, 0);
  pen.lineTo(-size / 2, size / 2);
  pen.lineTo(-size / 2, -size / 2);
  pen.closePath();
  pen.fill();
  pen.restore();
}

/**
 * Draw a goal: two rings, and a line that shows the heading. It must not look like a robot.
 * @param {Brush} brush
 * @param {{x: number, y: number, heading: number}} goal
 * @param {string} ink its colour
 */
export function drawGoal({ pen, colour, pixel }, { x, y, heading }, ink) {
  const size = GOAL_PX * pixel;
  pen.save();
  pen.translate(x, y);
  pen.rotate(heading);
  for (const [stroke, width] of [
    [colour.surface, 6 * pixel],
    [ink, 2.5 * pixel],
  ]) {
    pen.strokeStyle = stroke;
    pen.lineWidth = width;
    for (const radius of [size, size / 3]) {
      pen.beginPath();
      pen.arc(0, 0, radius, 0, 2 * Math.PI);
      pen.stroke();
    }
    pen.beginPath();
    pen.moveTo(size, 0);
    pen.lineTo(1.9 * size, 0);
    pen.stroke();
  }
  pen.restore();
}

/** Draw the diamond of a place. */
export function drawPlace({ pen, colour, pixel }, { x, y }) {
  const half = 6 * pixel;
  pen.save();
  pen.translate(x, y);
  pen.fillStyle = colour.place;
  pen.beginPath();
  for (const [dx, dy] of [
    [half, 0],
    [0, half],
    [-half, 0],
    [0, -half],
  ])
    pen.lineTo(dx, dy);
  pen.fill();
  pen.restore();
}
