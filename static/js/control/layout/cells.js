/** The cells of the picture area at a desk: each has one content, and each content at most one cell. Pure. */

/** Names of the cells, for the style sheet. */
export const CELLS = ["a", "b", "c", "d"];

/** In the order in which new cells get them. */
export const CONTENTS = ["camera", "plan", "map", "scene", "second", "plot"];

/** Return what a robot can show. @param {{cameras: ?object[], has_map: ?boolean}} facts of the robot */
export function contentsOf({ cameras = [], has_map: hasMap = false }) {
  const lacks = { camera: cameras.length < 1, second: cameras.length < 2, map: !hasMap };
  return CONTENTS.filter((content) => !lacks[content]);
}

/** Return as many cells as wanted: those of before, then the first contents that have no cell yet. */
export function resized(cells, count, offered) {
  const added = offered.filter((content) => !cells.includes(content));
  return [...cells, ...added].slice(0, count);
}

/** Put a content into a cell. The cell that had it gets the other one. */
export function placed(cells, at, content) {
  return cells.map((before, i) => {
    if (i === at) return content;
    return before === content ? cells[at] : before;
  });
}
