/**
 * The cells of the picture area at a desk: each has one content, and each content at most one cell. There may be
 * several plots: a plot's content names its topic and fields, "plot /odom pose.x". Pure.
 */

/** Names of the cells, for the style sheet. */
export const CELLS = ["a", "b", "c", "d"];

/** In the order in which new cells get them. */
const CONTENTS = ["camera", "plan", "map", "scene", "second"];

export const NEW_PLOT = "plot";

/** Return the first word of a content. */
export function kindOf(content) {
  return content.split(" ", 1)[0];
}

export function isPlot(content) {
  return kindOf(content) === NEW_PLOT;
}

/**
 * Return what a robot can show, without plots.
 * @param {{cameras: ?object[], has_map: ?boolean}} facts of the robot
 */
export function contentsOf({ cameras = [], has_map: hasMap = false }) {
  const lacks = { camera: cameras.length < 1, second: cameras.length < 2, map: !hasMap };
  return CONTENTS.filter((content) => !lacks[content]);
}

/** Return as many cells as wanted: those of before, then the first contents that have no cell yet, then plots. */
export function resized(cells, count, offered) {
  const added = offered.filter((content) => !cells.includes(content));
  return [...cells, ...added, ...Array(count).fill(NEW_PLOT)].slice(0, count);
}

/** Put a content into a cell. The cell that had it gets the other one; a new plot was in none. */
export function placed(cells, at, content) {
  const from = isPlot(content) ? -1 : cells.indexOf(content);
  return cells.map((before, i) => (i === at ? content : i === from ? cells[at] : before));
}
