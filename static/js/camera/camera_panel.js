/** The cameras on the control page: wires connection, pictures, views and head together. */

import { socketUrl } from "../connection/socket.js";
import { brief } from "../control/status/plain_words.js";
import { KeyPointer } from "../going/key_pointer.js";
import { FARTHEST_M } from "../going/way.js";
import { dim, mark } from "../lib/dom.js";
import { recall } from "../lib/prefs.js";
import { CameraSocket } from "./camera_socket.js";
import { CameraView } from "./camera_view.js";
import { floorAt } from "./floor_geometry.js";
import { FloorOverlay } from "./floor_overlay.js";
import { pixelUnder } from "./frame.js";
import { FullScreen } from "./full_screen.js";
import { Head } from "./head.js";
import { decodesVideo } from "./video.js";
import { Views } from "./view_choice.js";

const SLIM_PX = 480; // two pictures side by side would be too small
const UPDATE_MS = 100;
const REPORT_MS = 200;
const GONE_MS = 3000; // an older picture does not count: beside a plan, nobody drives by it any more

export class CameraPanel {
  static hears = ["facts", "view", "stale", "mayAct", "cells", "ghost"];
  #area;
  #socket;
  #main;
  #second;
  #floor;
  #head;
  #keys;
  #views;
  #fullScreen;
  #send;
  #tell;
  #snapshot;
  #facts = null;
  #mayAct = null;
  #reported = false;
  #reportMs = -Infinity;
  #mainSinceMs = 0; // since when the main camera is shown
  #isKnown = false; // whether the list of cameras is known
  #observer;
  #timer;
  #listening = new AbortController();

  /**
   * @param {import("../control/panels/page_panels.js").Page} page its root's data-camera is the address of the
   *   WebSocket, data-has-cameras: open it at once, because the first picture of a robot's camera takes some
   *   time
   */
  constructor({ root, parts, request, send, notify, tell }) {
    this.#area = parts["picture-area"];
    this.#send = send;
    this.#tell = tell;
    this.#snapshot = parts.snapshot;
    this.#socket = new CameraSocket(socketUrl(root.dataset.camera), decodesVideo());
    this.#main = new CameraView(parts.camera);
    this.#second = new CameraView(parts.second);
    this.#floor = new FloorOverlay(parts["camera-floor"]);
    this.#views = new Views(this.#area, parts);
    this.#head = new Head(parts["camera-floor"], parts["head-keys"], {
      request,
      header: () => this.#main.header,
      point: (pixel) => this.#point(pixel),
    });
    const floor = parts["camera-floor"];
    this.#keys = new KeyPointer(floor, parts["point-words"], {
      begins: [0.5, 0.75],
      pointAt: (spot) => this.#floorUnder(spot, floor),
      choose: (point) => this.#tellPointed(point, floor),
    });
    this.#fullScreen = new FullScreen(root, parts["full-screen"]);
    this.#listen(parts, notify);
    this.#observer = new ResizeObserver(() => {
      this.#makeRoom(root, parts);
      this.#follow();
    });
    for (const part of [this.#area, parts["view-bar"], parts["view-open"]])
      this.#observer.observe(part);
    this.#timer = setInterval(() => this.#update(), UPDATE_MS);
    if (root.dataset.hasCameras && !["plan", "scene"].includes(recall("camera-view")))
      this.#socket.open();
  }

  /** @param {object} facts of the robot; they are set again after the robot was edited */
  set facts(facts) {
    this.#facts = facts;
    this.#floor.facts = facts;
    this.#show(facts.cameras ?? []);
  }

  set view(view) {
    this.#floor.view = view;
  }

  /** @param {?import("../going/way.js").Way} ghost the robot where a person pressed */
  set ghost(ghost) {
    this.#floor.ghost = ghost;
  }

  /** @param {boolean} stale the newest view is too old */
  set stale(stale) {
    if (stale) this.#floor.view = null;
  }

  /** @param {?string[]} cells contents of the own layout; null: there is none */
  set cells(cells) {
    this.#views.cells = cells;
  }

  /** @param {?boolean} may whether this tab has control; null: not known yet */
  set mayAct(may) {
    this.#mayAct = may;
    this.#head.mayAct = may;
    if (may || !this.#reported) return;
    this.#report(null);
  }

  close() {
    clearInterval(this.#timer);
    this.#listening.abort();
    this.#observer.disconnect();
    const opened = [this.#socket, this.#main, this.#second, this.#floor, this.#head];
    for (const part of [...opened, this.#keys, this.#views, this.#fullScreen]) part.close();
  }

  #listen(parts, notify) {
    const { signal } = this.#listening;
    const warn = ({ code, text }) =>
      notify({ level: "warning", code: `camera ${code}`, text, short: brief(text) });
    const on = (target, type, act) =>
      target.addEventListener(type, (event) => act(event.detail), { signal });
    on(this.#socket, "open", () => this.#shown((view) => view.again()));
    on(this.#socket, "down", ({ isOver }) => this.#down(isOver));
    on(this.#socket, "cameras", (cameras) => this.#show(cameras));
    on(this.#socket, "picture", (picture) => this.#of(picture.header.camera)?.take(picture));
    on(this.#socket, "state", ({ camera, refusal, warning }) => {
      if (warning) warn(warning);
      const text = brief(refusal?.text ?? "");
      if (camera === null) this.#shown((view) => (view.why = text));
      else if (this.#of(camera)) this.#of(camera).why = text;
    });
    on(this.#socket, "notice", notify);
    on(this.#socket, "refused", ({ refusal }) => warn(refusal));
    for (const view of [this.#main, this.#second])
      on(view, "done", ({ header, damaged }) => this.#socket.acknowledge(header, damaged));
    on(this.#main, "painted", (header) => (this.#floor.header = header));
    on(this.#views, "change", () => this.#follow());
    on(parts.snapshot, "click", () => this.#main.save(this.#facts?.slug));
  }

  /**
   * Give the size of the view's buttons to the style sheet: running tasks must not cover them; and whether there is
   * more room side by side or one below the other, or too little side by side.
   */
  #makeRoom(root, { "view-bar": bar, "view-open": opener }) {
    const { clientWidth: width, clientHeight: height } = this.#area;
    mark(this.#area, "broad", width > 2 * height ? "twice" : width > height);
    mark(this.#area, "slim", width < SLIM_PX);
    const isBelow = ["2", "bar"].includes(getComputedStyle(bar).gridRowStart);
    root.style.setProperty("--view-bar", `${isBelow ? bar.offsetHeight : 0}px`);
    root.style.setProperty("--view-open", `${opener.offsetWidth}px`);
  }

  /** Take a list of cameras. Both connections send it: the faster one does not wait for the other. */
  #show(cameras) {
    this.#isKnown = true;
    this.#views.cameras = cameras;
  }

  #shown(act) {
    for (const view of [this.#main, this.#second]) if (view.camera) act(view);
  }

  /**
   * Tell that a person pressed on the floor. Farther away one pixel is too much of the floor.
   * @param {?number[]} pixel of the main camera's picture; null: the person meant something else
   * @returns {boolean} whether the pixel shows the floor near the robot
   */
  #point(pixel) {
    const point = pixel && this.#floorAt(pixel);
    if (point) this.#tellPointed(point);
    else this.#tell({ pointed: null });
    return point !== null;
  }

  /** @param {?HTMLElement} from the picture in which keys pointed */
  #tellPointed(point, from = null) {
    const look = this.#main.camera.moves ? (there) => this.#head.lookAt(there) : null;
    this.#tell({ pointed: { point, look, from } });
  }

  /** Return the point of the floor near the robot at a pixel; null: the picture does not show it there. */
  #floorAt(pixel) {
    const { header } = this.#main;
    const point = header?.lens && header.pose ? floorAt(pixel, header) : null;
    return point && Math.hypot(...point) <= FARTHEST_M ? point : null;
  }

  #floorUnder(spot, { clientWidth, clientHeight }) {
    const { header } = this.#main;
    return header && this.#floorAt(pixelUnder(spot, header, clientWidth, clientHeight));
  }

  #of(camera) {
    return [this.#main, this.#second].find((view) => view.camera?.name === camera) ?? null;
  }

  #down(isOver) {
    const text = isOver
      ? gettext("No more pictures of this robot are shown here. Load the page again.")
      : gettext("No connection for pictures. Connecting again by itself.");
    this.#shown((view) => (view.why = text));
  }

  /** Watch the cameras that are shown, and no others. */
  #follow() {
    const isShown = this.#area.clientWidth > 0; // some tabs hide the picture
    const shown = (content) => isShown && this.#views.shows(content);
    this.#tell({ sceneShown: shown("scene"), mapShown: shown("map"), plotShown: shown("plot") });
    if (this.#views.view === "scene") this.#tell({ pointed: null }); // 3D draws no ghost
    const before = [this.#main, this.#second].map((view) => view.camera?.name);
    const main = isShown ? this.#views.main : null;
    const second = isShown ? this.#views.second : null;
    if (main?.name !== this.#main.camera?.name) this.#mainSinceMs = performance.now();
    this.#main.camera = main;
    this.#second.camera = second;
    this.#floor.header = this.#main.header;
    this.#head.moves = Boolean(main?.moves);
    for (const name of before)
      if (name && name !== main?.name && name !== second?.name) this.#socket.end(name);
    const isLarge = this.#views.view === "own"; // the second camera has a cell of its own
    if (main || second) {
      this.#socket.open();
      if (main) this.#socket.watch(main.name, "full");
      if (second) this.#socket.watch(second.name, isLarge ? "full" : "small");
    } else if (this.#isKnown) {
      this.#socket.close();
    }
    this.#update();
  }

  #update() {
    this.#shown((view) => view.update());
    dim(this.#snapshot, !this.#main.header, gettext("There is no picture to save yet."));
    this.#reportAge();
  }

  /** Report the age of the picture by which this person drives: the gate takes it into account. */
  #reportAge() {
    if (!this.#mayAct) return;
    const nowMs = performance.now();
    const ageMs = this.#drivenBy();
    if (ageMs === null ? !this.#reported : nowMs - this.#reportMs < REPORT_MS) return;
    this.#reportMs = nowMs;
    this.#report(ageMs);
  }

  #report(ageMs) {
    this.#reported = ageMs !== null;
    this.#send({ t: "camera_view", age_ms: ageMs });
  }

  /** Return the age of the picture by which this person drives. Null: none, or too old beside a plan. */
  #drivenBy() {
    if (!this.#main.camera) return null;
    const ageMs = this.#main.ageMs ?? performance.now() - this.#mainSinceMs;
    return this.#views.shows("plan") && ageMs > GONE_MS ? null : ageMs;
  }
}
