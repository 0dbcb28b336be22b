/**
 * The robot and its surroundings in 3D. Loaded when the view is first opened. Metres, z up: the frame of the
 * map if the robot knows its pose on it, else the frame of its odometry. Drawn when something has changed, at
 * most once per frame.
 */

import { PerspectiveCamera, Scene, WebGLRenderer } from "../../vendor/scene/library.js";
import { coloursOf, onNewColours } from "../lib/colours.js";
import { numbersOf } from "./colour_numbers.js";
import { drawsInSoftware, Pace } from "./pace.js";
import { RobotModel } from "./robot_model.js";
import { Surroundings } from "./surroundings.js";
import { Viewpoint } from "./viewpoint.js";

const COLOURS = [
  "surface",
  "grid",
  "grid-text",
  "laser",
  "depth",
  "remembered",
  "robot",
  "robot-edge",
  "arm",
  "path",
  "path-body",
  "hold",
];
const GLIDE_S = 0.08; // time constant with which the drawn robot follows the reported pose
const LONGEST_STEP_MS = 100; // of the drawn robot's motion
const AT_REST = 1e-4; // metres or radians
const LOST_MS = 3_000; // after this time, a lost picture is made again
const MOST_TRIES = 3; // in a row
const STEADY_MS = 60_000; // after a picture that lasted this long, the tries are counted from 0 again

const NO_WEBGL = () =>
  gettext(
    "This browser cannot draw in 3D: WebGL is missing or switched off. The plan shows the same from above.",
  );

/** Events: "words" (why nothing is drawn, or ""), "notes" (a list of texts), "mode". */
export class SceneView extends EventTarget {
  #place;
  #help;
  #canvas = null;
  #renderer = null;
  #scene = new Scene();
  #camera = new PerspectiveCamera(50, 1, 0.05, 200);
  #viewpoint = null;
  #robot;
  #around;
  #pace = null;
  #frame = null;
  #framesDrawn = 0;
  #lastMs = Number.NEGATIVE_INFINITY; // time of the last frame
  #askedMs = 0; // time at which the next frame was requested
  #shown = false;
  #pose = null; // where the robot is drawn: x, y, heading
  #wanted = null;
  #inMap = false;
  #glides = !matchMedia("(prefers-reduced-motion: reduce)").matches;
  #words = "";
  #tries = 0;
  #begunMs = 0;
  #lostTimer = null;
  #observer;
  #listening = new AbortController();

  /** @param {HTMLElement} place in which the canvas is made @param {string} help its label */
  constructor(place, help) {
    super();
    this.#place = place;
    this.#help = help;
    this.#robot = new RobotModel(
      () => this.#redraw(),
      (notes) => this.dispatchEvent(new CustomEvent("notes", { detail: notes })),
    );
    this.#around = new Surroundings();
    this.#scene.add(this.#robot.group, this.#around.world);
    this.#robot.group.add(this.#around.local);
    this.#observer = new ResizeObserver(() => this.#fit());
    this.#observer.observe(place);
    onNewColours(() => this.#recolour(), this.#listening.signal);
  }

  /** @returns {boolean} whether this browser draws in 3D */
  begin() {
    const canvas = document.createElement("canvas");
    canvas.className = "scene-canvas";
    canvas.tabIndex = 0;
    canvas.dir = "ltr";
    canvas.setAttribute("role", "application");
    canvas.setAttribute("aria-label", this.#help);
    try {
      const slow = drawsInSoftware();
      this.#renderer = new WebGLRenderer({ canvas, antialias: !slow });
      this.#pace ??= new Pace(slow);
    } catch {
      this.#showText(NO_WEBGL());
      return false;
    }
    this.#begunMs = performance.now();
    this.#canvas?.remove();
    this.#canvas = canvas;
    this.#place.prepend(canvas);
    canvas.addEventListener("webglcontextlost", (event) => this.#lost(event));
    canvas.addEventListener("webglcontextrestored", () => this.#restored());
    const before = this.#viewpoint;
    this.#viewpoint = new Viewpoint(this.#camera, canvas, () => this.#redraw());
    if (before) {
      this.#viewpoint.takeFrom(before);
      before.close();
    }
    this.#viewpoint.addEventListener("mode", ({ detail }) =>
      this.dispatchEvent(new CustomEvent("mode", { detail })),
    );
    this.#recolour();
    this.#fit();
    this.#showText("");
    return true;
  }

  /** @returns {boolean} whether there is a picture, or a lost picture that is made again */
  get draws() {
    return this.#renderer !== null;
  }

  get words() {
    return this.#words;
  }

  /** @returns {"orbit" | "follow" | "top"} */
  get mode() {
    return this.#viewpoint?.mode ?? "orbit";
  }

  set mode(mode) {
    this.#viewpoint?.choose(mode, this.#pose);
  }

  /** Whether the view is visible. If not, nothing is drawn. */
  set shown(shown) {
    this.#shown = shown;
    if (shown) this.#fit();
  }

  set facts(facts) {
    this.#robot.footprint = facts.footprint;
    this.#around.footprint = facts.footprint;
    this.#redraw();
  }

  /** @param {{state: object, scan: ?object, joints?: Record<string, number>}} view */
  set view({ state, scan, joints = {} }) {
    const { location = null, odometry } = state;
    this.#inMap = location !== null;
    this.#wanted = location
      ? [location.x, location.y, location.heading]
      : odometry
        ? [odometry.x, odometry.y, odometry.yaw]
        : this.#wanted;
    this.#robot.joints = joints;
    this.#around.show(scan, state.verdict, this.#inMap);
    this.#redraw();
  }

  set path(path) {
    this.#around.path = path;
    this.#redraw();
  }

  /** @param {?object} description as the API gives it */
  describe(description) {
    this.#robot.describe(description);
    this.#redraw();
  }

  /** @param {object} map as the API describes it @param {CanvasImageSource} picture */
  showMap(map, picture) {
    this.#around.showMap(map, picture);
    this.#redraw();
  }

  /** The position of a joint as it is drawn, or null. */
  joint(name) {
    return this.#robot.joint(name);
  }

  /** Facts about the drawn scene, for tests and benchmarks. */
  get figures() {
    return {
      frames: this.#framesDrawn,
      points: this.#around.count,
      holds: this.#around.holds,
      hasMap: this.#around.hasMap,
      triangles: this.#renderer?.info.render.triangles ?? 0,
      pixels: this.#canvas ? [this.#canvas.width, this.#canvas.height] : [0, 0],
      links: this.#robot.links,
      pose: this.#pose,
      eye: this.#camera.position.toArray(),
      size: this.#robot.size,
    };
  }

  /** For benchmarks: show this number of points around the robot, in addition to the others. */
  fill(points) {
    this.#around.fill(points);
    this.#redraw();
  }

  close() {
    this.#listening.abort();
    this.#observer.disconnect();
    cancelAnimationFrame(this.#frame);
    clearTimeout(this.#lostTimer);
    this.#viewpoint?.close();
    this.#renderer?.dispose();
  }

  // --- frames ------------------------------------------------------------------------------------

  #redraw() {
    if (!this.#shown || !this.#renderer || this.#frame !== null) return;
    this.#askedMs = performance.now();
    this.#await();
  }

  #await() {
    this.#frame = requestAnimationFrame((ms) => {
      this.#frame = null;
      this.#paint(ms);
    });
  }

  #paint(ms) {
    if (!this.#shown || !this.#renderer || this.#renderer.getContext().isContextLost()) return;
    if (ms - this.#lastMs < this.#pace.leastMs) return this.#await();
    const beganMs = performance.now();
    const moves = this.#move(Math.min(ms - this.#lastMs, LONGEST_STEP_MS) / 1000);
    this.#renderer.render(this.#scene, this.#camera);
    // Where software draws, the page waits for the picture after this task.
    setTimeout(() => Object.assign(this.#pace, { tookMs: performance.now() - beganMs }));
    this.#framesDrawn += 1;
    // The time that this picture waited: from its request, or from the last picture if that came later.
    const waitedMs = ms - Math.max(this.#lastMs, this.#askedMs);
    this.#lastMs = ms;
    if (this.#pace.addFrameTime(waitedMs)) this.#fit();
    if (moves) this.#redraw();
  }

  /** Move the drawn robot towards the reported pose. @returns {boolean} whether it still moves */
  #move(seconds) {
    const fraction = this.#glides ? 1 - Math.exp(-seconds / GLIDE_S) : 1;
    let moves = this.#robot.glide(fraction);
    if (!this.#wanted) return moves;
    const before = this.#pose ?? this.#wanted;
    const far = Math.hypot(this.#wanted[0] - before[0], this.#wanted[1] - before[1]) > 1;
    this.#pose = far ? this.#wanted : between(before, this.#wanted, fraction);
    moves ||= away(this.#pose, this.#wanted) > AT_REST;
    const [x, y, heading] = this.#pose;
    this.#robot.group.position.set(x, y, 0);
    this.#robot.group.rotation.set(0, 0, heading);
    this.#viewpoint.carry(this.#pose);
    return moves;
  }

  #fit() {
    const { clientWidth: width, clientHeight: height } = this.#place;
    if (!this.#renderer || !width || !height) return;
    const ratio = this.#pace.ratio(width, height, devicePixelRatio || 1);
    this.#renderer.setPixelRatio(ratio);
    this.#renderer.setSize(width, height, false);
    this.#camera.aspect = width / height;
    this.#camera.updateProjectionMatrix();
    this.#redraw();
  }

  #recolour() {
    const found = coloursOf(
      this.#place,
      COLOURS.map((name) => `--view-${name}`),
    ).map(numbersOf);
    const colours = Object.fromEntries(COLOURS.map((name, i) => [name, found[i]]));
    this.#renderer?.setClearColor(colours.surface.colour);
    this.#robot.colours = colours;
    this.#around.colours = colours;
    this.#redraw();
  }

  // --- loss of the WebGL context -------------------------------------------------------------------

  #lost(event) {
    event.preventDefault(); // else the browser never restores the context
    this.#showText(gettext("The browser lost the 3D picture. It begins again by itself."));
    clearTimeout(this.#lostTimer);
    this.#lostTimer = setTimeout(() => this.#anew(), LOST_MS);
  }

  #restored() {
    clearTimeout(this.#lostTimer);
    this.#showText("");
    this.#fit();
  }

  #anew() {
    if (performance.now() - this.#begunMs > STEADY_MS) this.#tries = 0;
    this.#tries += 1;
    const old = this.#renderer;
    this.#renderer = null;
    old.dispose();
    if (this.#tries > MOST_TRIES)
      this.#showText(
        gettext(
          "The browser lost the 3D picture again and again. Load the page again, or use the plan.",
        ),
      );
    else this.begin();
  }

  #showText(words) {
    this.#words = words;
    this.dispatchEvent(new CustomEvent("words", { detail: words }));
  }
}

function turned(from, to) {
  return Math.atan2(Math.sin(to - from), Math.cos(to - from));
}

function between(from, to, fraction) {
  return [
    from[0] + fraction * (to[0] - from[0]),
    from[1] + fraction * (to[1] - from[1]),
    from[2] + fraction * turned(from[2], to[2]),
  ];
}

function away(from, to) {
  return Math.max(
    Math.abs(to[0] - from[0]),
    Math.abs(to[1] - from[1]),
    Math.abs(turned(from[2], to[2])),
  );
}
