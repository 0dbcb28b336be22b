/** Plain words for what robots and bridges call by technical names. *Details* has both. Pure. */

const EIGHTH = Math.PI / 4;

/** The sides of the robot, counter-clockwise from its front. */
function distanceSensors() {
  return [
    gettext("front distance sensor"),
    gettext("front left distance sensor"),
    gettext("left distance sensor"),
    gettext("rear left distance sensor"),
    gettext("rear distance sensor"),
    gettext("rear right distance sensor"),
    gettext("right distance sensor"),
    gettext("front right distance sensor"),
  ];
}

/** A range sensor's plain name, by the way it looks. @param {number} yaw radians, counter-clockwise from ahead */
export function distanceSensorName(yaw) {
  const eighth = Math.round(yaw / EIGHTH) % 8;
  return distanceSensors()[(eighth + 8) % 8];
}

/** @param {{name: string, kind: string}} sensor @param {Map<string, string>} known plain names by technical ones */
export function sensorName({ name, kind }, known) {
  const kinds = {
    scan: gettext("laser scanner"),
    depth: gettext("depth camera"),
    odometry: gettext("wheel sensors"),
    sonar: gettext("distance sensor"),
  };
  return known.get(name) ?? kinds[kind] ?? name;
}

/** The plain names of a robot's range sensors, by their technical ones. @param {{name: string, yaw: number}[]} sonars */
export function namesOf(sonars) {
  return new Map(sonars.map(({ name, yaw }) => [name, distanceSensorName(yaw)]));
}

/** A bridge's sentence with plain names in it. @param {Map<string, string>} [names] as of `namesOf` */
export function plain(text, names = new Map()) {
  let plainer = text;
  for (const [technical, name] of names) plainer = plainer.replaceAll(technical, name);
  return plainer.replace(/\bsonar(s?)\b/g, "distance sensor$1");
}

/** The same without brackets that hold technical names: *Details* has them. */
export function brief(text, names) {
  return plain(text, names).replace(/ \([^()]*(?:\w_\w|\B\/\w|\btf\b)[^()]*\)/g, "");
}

/** The way of a stick position to the robot, in plain words. @param {string} steps in the bridge's words */
export function stickWords(steps) {
  return steps === "no filter"
    ? gettext("goes to the robot as it is")
    : gettext("steadied: a trembling hand does not shake the robot");
}
