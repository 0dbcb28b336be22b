/** The robot's position at a moment of a control session, and the entry before. Times: s from the begin. */

/** Seconds, x, y in units of the picture, degrees. @typedef {[number, number, number, number]} Sample */

/**
 * Return the position: interpolated between the samples of a drive; between drives, the end of the last
 * drive; before the first drive, its begin.
 * @param {Sample[][]} drives in order of time, none of them empty
 * @param {number} atS
 * @returns {{x: number, y: number, degrees: number, moving: boolean} | null} null: there was no drive
 */
export function placeAt(drives, atS) {
  if (drives.length === 0) return null;
  const drive = drives.findLast(([first]) => first[0] <= atS);
  if (!drive) return standing(drives[0][0]);
  const next = drive.findIndex(([time]) => time > atS);
  if (next < 0) return standing(drive.at(-1));
  const [before, after] = [drive[next - 1], drive[next]];
  const share = (atS - before[0]) / (after[0] - before[0]);
  const [, x, y, degrees] = before.map((value, i) => value + share * (after[i] - value));
  return { x, y, degrees, moving: true };
}

function standing([, x, y, degrees]) {
  return { x, y, degrees, moving: false };
}

/** Return the index of the last of these sorted times that is not later than `atS`; -1: none. */
export function lastAt(timesS, atS) {
  return timesS.findLastIndex((time) => time <= atS);
}
