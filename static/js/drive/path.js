/** Plane geometry of the base frame: x forward, y left, metres and radians. */

const STRAIGHT_RADPS = 1e-4;

/**
 * Pose of the base after driving a constant twist for some time: on an arc, or a line.
 * @param {{vx: number, vy: number, w: number}} twist
 * @param {number} seconds
 * @returns {{x: number, y: number, yaw: number}}
 */
export function poseAfter({ vx, vy, w }, seconds) {
  const yaw = w * seconds;
  if (Math.abs(w) < STRAIGHT_RADPS) return { x: vx * seconds, y: vy * seconds, yaw };
  const s = Math.sin(yaw) / w;
  const c = (1 - Math.cos(yaw)) / w;
  return { x: vx * s - vy * c, y: vx * c + vy * s, yaw };
}

/** The poses along that arc, the last one included. */
export function arc(twist, seconds, steps) {
  return Array.from({ length: steps }, (_, i) => poseAfter(twist, (seconds * (i + 1)) / steps));
}

/** An outline [[x, y], ...] carried to a pose. */
export function carried(outline, { x, y, yaw }) {
  const c = Math.cos(yaw);
  const s = Math.sin(yaw);
  return outline.map(([px, py]) => [x + px * c - py * s, y + px * s + py * c]);
}

/** The radius of the circle about the base's centre that holds an outline. */
export function reach(outline) {
  return Math.max(0, ...outline.map(([x, y]) => Math.hypot(x, y)));
}

/** Half the distances shown, in metres: the smallest step that still shows most of what is near. */
const SPANS_M = [2, 3, 4.5, 6.5];
const SHOWN_SHARE = 0.7;
const CALM = 0.08; // a step is left only when it is clearly wrong: the picture must not pump

/**
 * The span that shows a scan well.
 * @param {readonly number[]} laserCm flat [x0, y0, x1, y1, ...]
 * @param {number} current the span shown now
 */
export function spanFor(laserCm, current) {
  const total = laserCm.length / 2;
  if (total === 0) return current;
  const shareWithin = (span) => {
    let inside = 0;
    for (let i = 0; i < laserCm.length; i += 2) {
      if (Math.hypot(laserCm[i], laserCm[i + 1]) <= span * 100) inside += 1;
    }
    return inside / total;
  };
  const fitting = SPANS_M.find((span) => shareWithin(span) >= SHOWN_SHARE) ?? SPANS_M.at(-1);
  if (fitting > current) return shareWithin(current) < SHOWN_SHARE - CALM ? fitting : current;
  return fitting < current && shareWithin(fitting) > SHOWN_SHARE + CALM ? fitting : current;
}
