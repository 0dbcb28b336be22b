/** Plain words for the technical names of robots and bridges. *Details* has both. Pure. */

import { sentence } from "../../formats/sentences.js";

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

/**
 * Return a range sensor's plain name, by its direction.
 * @param {number} yaw radians, counter-clockwise from forward
 */
export function distanceSensorName(yaw) {
  const eighth = Math.round(yaw / EIGHTH) % 8;
  return distanceSensors()[(eighth + 8) % 8];
}

/**
 * @param {{name: string, kind: string}} sensor
 * @param {Map<string, string>} known plain names by technical names
 */
export function sensorName({ name, kind }, known) {
  const kinds = {
    scan: gettext("laser scanner"),
    depth: gettext("depth camera"),
    odometry: gettext("wheel sensors"),
    sonar: gettext("distance sensor"),
  };
  return known.get(name) ?? kinds[kind] ?? name;
}

/**
 * Return the plain names of a robot's range sensors, by their technical names.
 * @param {{name: string, yaw: number}[]} sonars
 */
export function namesOf(sonars) {
  return new Map(sonars.map(({ name, yaw }) => [name, distanceSensorName(yaw)]));
}

/** Return a bridge's sentence with plain names. @param {Map<string, string>} [names] as of `namesOf` */
export function plain(text, names = new Map()) {
  let plainer = text;
  for (const [technical, name] of names) plainer = plainer.replaceAll(technical, name);
  return plainer.replace(/\bsonar(s?)\b/g, "distance sensor$1");
}

/** Return the same without technical names in brackets: *Details* has them. */
export function brief(text, names) {
  return plain(text, names).replace(/ \([^()]*(?:\w_\w|\B\/\w|\btf\b)[^()]*\)/g, "");
}

/**
 * Return a text about the filters between stick and robot.
 * @param {string} steps the filters, in the page’s language
 */
export function stickWords(steps) {
  return steps === sentence(["no filter"])
    ? gettext("goes to the robot as it is")
    : gettext("smoothed: a trembling hand does not shake the robot");
}
