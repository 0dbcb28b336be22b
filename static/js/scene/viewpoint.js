/** The viewpoint of the scene: around the robot, behind it, or from above. Mouse, touch and keys move it. */

import { MOUSE, OrbitControls, TOUCH, Vector3 } from "../../vendor/scene/library.js";

const MODES = { o: "orbit", f: "follow", t: "top" };
const LOOKS_AT_M = 0.5; // height of the point in the middle
const STARTS = {
  orbit: [-2.2, -2.2, 2.0], // from the robot, along its heading
  follow: [-3.0, 0, 2.2],
  top: [0, -0.001, 8.0], // north is up
};
const TURN = Math.PI / 24;
const ZOOM = 1.2;
const NEAREST_M = 0.4;
const FARTHEST_M = 60;
const UP = new Vector3(0, 0, 1);

/** Event: "mode". */
export class Viewpoint extends EventTarget {
  #camera;
  #controls;
  #mode = "orbit";
  #pose = null;
  #listening = new AbortController();

  /** @param {object} camera @param {HTMLCanvasElement} canvas @param {() => void} changed */
  constructor(camera, canvas, changed) {
    super();
    this.#camera = camera;
    camera.up.set(0, 0, 1);
    const controls = new OrbitControls(camera, canvas);
    controls.minDistance = NEAREST_M;
    controls.maxDistance = FARTHEST_M;
    controls.maxPolarAngle = Math.PI / 2 - 0.02; // never below the floor
    controls.zoomSpeed = 1.5;
    controls.addEventListener("change", changed);
    this.#controls = controls;
    this.#place([0, 0, 0]);
    canvas.addEventListener("keydown", (event) => this.#typed(event), {
      signal: this.#listening.signal,
    });
  }

  get mode() {
    return this.#mode;
  }

  /**
   * Choose a mode; the same mode again returns to its first viewpoint.
   * @param {?number[]} pose of the robot
   */
  choose(mode, pose) {
    if (!(mode in STARTS)) return;
    this.#mode = mode;
    const fromAbove = mode === "top";
    this.#controls.enableRotate = !fromAbove;
    this.#controls.mouseButtons.LEFT = fromAbove ? MOUSE.PAN : MOUSE.ROTATE;
    this.#controls.touches.ONE = fromAbove ? TOUCH.PAN : TOUCH.ROTATE;
    this.#pose = pose ?? this.#pose;
    this.#place(this.#pose ?? [0, 0, 0]);
    this.dispatchEvent(new CustomEvent("mode", { detail: mode }));
  }

  /** Move with the robot; in mode "follow", also turn with it. @param {number[]} pose x, y, heading */
  carry(pose) {
    if (!this.#pose) {
      this.#pose = pose;
      this.#place(pose);
      return;
    }
    const [x, y, heading] = this.#pose;
    this.#pose = pose;
    const [dx, dy, turn] = [pose[0] - x, pose[1] - y, pose[2] - heading];
    if (!dx && !dy && !turn) return;
    const { target } = this.#controls;
    if (this.#mode === "follow" && turn) {
      const robot = new Vector3(x, y, 0);
      for (const point of [target, this.#camera.position])
        point.sub(robot).applyAxisAngle(UP, turn).add(robot);
    }
    const way = new Vector3(dx, dy, 0);
    target.add(way);
    this.#camera.position.add(way);
    this.#controls.update();
  }

  /** Take mode and pose from a viewpoint whose canvas was lost. */
  takeFrom(other) {
    this.choose(other.mode, other.pose);
  }

  get pose() {
    return this.#pose;
  }

  close() {
    this.#listening.abort();
    this.#controls.dispose();
  }

  #place(pose) {
    const [x, y, heading] = pose;
    const start = new Vector3(...STARTS[this.#mode]);
    if (this.#mode !== "top") start.applyAxisAngle(UP, heading);
    this.#controls.target.set(x, y, this.#mode === "top" ? 0 : LOOKS_AT_M);
    this.#camera.position.copy(this.#controls.target).add(start);
    this.#controls.update();
  }

  /** While the scene has the focus, arrow keys turn it and do not drive the robot. */
  #typed(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const act = this.#keys[event.key] ?? this.#keys[event.key.toLowerCase()];
    if (!act) return;
    event.preventDefault();
    event.stopPropagation();
    act();
    this.#controls.update();
  }

  get #keys() {
    const turn = (around, up) => () => this.#turn(around, up);
    const zoom = (factor) => () => this.#zoom(factor);
    const modes = Object.entries(MODES).map(([key, mode]) => [
      key,
      () => this.choose(mode, this.#pose),
    ]);
    return {
      ArrowLeft: turn(-TURN, 0),
      ArrowRight: turn(TURN, 0),
      ArrowUp: turn(0, TURN),
      ArrowDown: turn(0, -TURN),
      "+": zoom(1 / ZOOM),
      "-": zoom(ZOOM),
      0: () => this.choose(this.#mode, this.#pose),
      ...Object.fromEntries(modes),
    };
  }

  #turn(around, up) {
    const { target, maxPolarAngle } = this.#controls;
    const position = this.#camera.position;
    const from = position.clone().sub(target);
    if (this.#mode === "top") {
      const step = from.length() / 12;
      const way = new Vector3(Math.sign(around) * step, Math.sign(up) * step, 0);
      target.add(way);
      position.add(way);
      return;
    }
    from.applyAxisAngle(UP, around);
    const polar = from.angleTo(UP);
    const wanted = Math.min(Math.max(polar - up, 0.05), maxPolarAngle);
    const side = new Vector3().crossVectors(UP, from).normalize();
    from.applyAxisAngle(side, wanted - polar);
    position.copy(target).add(from);
  }

  #zoom(factor) {
    const { target } = this.#controls;
    const from = this.#camera.position.clone().sub(target);
    const length = Math.min(Math.max(from.length() * factor, NEAREST_M), FARTHEST_M);
    this.#camera.position.copy(target).add(from.setLength(length));
  }
}
