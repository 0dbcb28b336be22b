/** The panel "Map" over the picture: loads the robot's map, and sends the goals and poses chosen on it. */

import { whyNotNow } from "../control/lease.js";
import { isSeen } from "../control/status/status_text.js";
import { dim, make, mark, setText, setTextOrHide, show } from "../lib/dom.js";
import { TWO_TAPS_MS } from "../lib/presses.js";
import { leftOf, limits } from "../tasks/lesson_tasks.js";
import { NewEnds } from "../tasks/task_ends.js";
import { MapView } from "./map_view.js";
import { readMaps, readPicture } from "./places_api.js";
import { PlacesPanel } from "./places_panel.js";
import { goRequest, rounded } from "./requests.js";
import { endNotice, goingText } from "./words.js";

const LOOK_MS = 2_000; // between two reads, while the panel is open and has no map
const AGAIN_EVERY = 10; // times LOOK_MS: a known map is read again, because the robot may have another map
const ZOOM = 1.5;
const MODES = ["go", "pose", "place"];
const IN_CONTROL = ["go", "pose"];

export class MapPanel {
  static hears = [
    "facts",
    "view",
    "state.going",
    "go_path",
    "stale",
    "mayAct",
    "fence",
    "tasks",
    "mapShown",
  ];
  static task = "going";
  static requests = {
    go: { name: () => gettext("Go there") },
    go_cancel: { name: () => gettext("Cancel the drive to a place"), ends: true },
    set_pose: {
      name: () => gettext("Robot is here"),
      done: () => gettext("The robot was told where it is."),
    },
  };
  #root;
  #tasks = null;
  #parts;
  #robot;
  #footprint = [];
  #places;
  #request;
  #notify;
  #tell;
  #view = null; // made when the panel is first opened
  #mode = null; // one of MODES, or null
  #wanted = ""; // text: what a press on the map lacked
  #mayAct = null;
  #path = [];
  #newest = null;
  #ends;
  #loaded = null; // the map that is shown
  #picked = null; // pressed on the map: a named place, or the pose of the ghost, which has no number
  #pickedMs = 0;
  #hasMap = false;
  #hasCell = false; // the map has a cell of the own layout; otherwise it lies over all pictures
  #timer = null;
  #listening = new AbortController();

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ root: { dataset }, parts, request, notify, tell }) {
    const root = parts["picture-area"];
    this.#root = root;
    this.#parts = parts;
    this.#robot = dataset.robot;
    this.#request = request;
    this.#ends = new NewEnds((ended) => notify(endNotice(ended)));
    this.#notify = notify;
    this.#tell = tell;
    const { signal } = this.#listening;
    const on = (part, act) => parts[part].addEventListener("click", act, { signal });
    on("map-open", () => this.#open(parts.map.hidden));
    on("camera-swap", () => this.#open(false));
    on("map-go", () => this.#choose("go"));
    on("map-pose", () => this.#choose("pose"));
    on("map-place", () => this.#choose("place"));
    const ends = (event) => {
      if (event.key !== "Escape" || (this.#mode === null && !this.#picked)) return;
      event.preventDefault();
      this.#pick(null);
      this.#choose(null);
    };
    root.addEventListener("keydown", ends, { signal });
    on("map-in", () => this.#view.zoom(ZOOM));
    on("map-out", () => this.#view.zoom(1 / ZOOM));
    on("map-fit", () => this.#view.fit());
    on("map-picked-go", () => {
      if (performance.now() - this.#pickedMs > TWO_TAPS_MS) this.#goTo(this.#picked);
    });
    for (const part of ["map-picked-close", "map-places"]) on(part, () => this.#pick(null));
    this.#places = new PlacesPanel(parts, {
      go: (place) => this.#goTo(place),
      choose: () => this.#choose("place"),
      here: () => rounded(this.#newest?.state.location ?? null),
      changed: () => this.#load(),
      notify,
    });
  }

  /** @param {object} facts of the robot: it may have a map without knowing its pose on it */
  set facts({ has_map: hasMap = false, footprint = [] }) {
    this.#footprint = footprint;
    if (this.#view) this.#view.footprint = footprint;
    this.#hasMap = hasMap;
    show(this.#parts["map-open"], hasMap && !this.#hasCell);
    if (!hasMap && !this.#parts.map.hidden) this.#open(false);
  }

  /** @param {boolean} shown whether the map has a cell of the own layout */
  set mapShown(shown) {
    if (shown === this.#hasCell) return;
    this.#hasCell = shown;
    show(this.#parts["map-open"], this.#hasMap && !shown);
    this.#open(shown);
  }

  /** @param {{state: object, scan: ?object}} view of the robot */
  set view(view) {
    this.#newest = view;
    if (this.#parts.map.hidden) return;
    this.#view.view = view;
    this.#speak();
  }

  /** @param {{now: ?object, ended: ?object}} going the drive to a goal */
  set going({ ended }) {
    this.#ends.follow({ going: ended });
  }

  shows({ now }) {
    return now && { words: goingText(now), who: now.who, cancel: [{ t: "go_cancel" }] };
  }

  /** @param {{path_cm: number[]}} message the planned path: flat x, y in the frame of the map */
  set go_path({ path_cm: path }) {
    this.#path = path;
    if (this.#view) this.#view.path = path;
  }

  /** @param {?boolean} may whether this tab has control; null: not known yet */
  set mayAct(may) {
    this.#mayAct = may;
    this.#places.mayAct = may;
    dim(this.#parts["map-picked-go"], !may, whyNotNow());
  }

  /** @param {?number} fence of this tab's control; null: it has none. A silence of a moment ends no choice */
  set fence(fence) {
    if (fence === null && IN_CONTROL.includes(this.#mode)) this.#choose(null);
  }

  /** @param {?object} tasks that the present lesson leaves; null: all. With chosen places, no point is a goal */
  set tasks(tasks) {
    this.#tasks = tasks;
    show(this.#parts["map-go"], !limits(tasks, "places"));
    this.#pick(null);
    if (!this.#parts.map.hidden) this.#load();
  }

  /** @param {boolean} stale the map shows old data */
  set stale(stale) {
    mark(this.#parts.map, "old", stale);
  }

  gone() {
    this.go_path = { path_cm: [] };
  }

  close() {
    this.#listening.abort();
    clearInterval(this.#timer);
    this.#view?.close();
    this.#places.close();
  }

  #open(opens) {
    show(this.#parts.map, opens);
    mark(this.#root, "mapped", opens && !this.#hasCell);
    this.#parts["map-open"].setAttribute("aria-expanded", String(opens));
    clearInterval(this.#timer);
    if (!opens) {
      this.#places.open(false);
      this.#pick(null);
      return this.#choose(null);
    }
    if (!this.#hasCell) this.#tell({ pointed: null }); // the map hides the plan and its ghost
    if (!this.#view) this.#begin();
    if (this.#newest) this.view = this.#newest;
    this.#view.path = this.#path;
    let looks = 0;
    this.#timer = setInterval(() => {
      looks += 1;
      if (this.#loaded === null || looks % AGAIN_EVERY === 0) this.#load();
    }, LOOK_MS);
    this.#load();
  }

  #begin() {
    const canvas = make("canvas", { className: "map-canvas" });
    canvas.tabIndex = 0;
    canvas.dir = "ltr";
    canvas.setAttribute("role", "application");
    canvas.setAttribute("aria-label", this.#parts.map.dataset.help);
    this.#parts.map.prepend(canvas);
    this.#view = new MapView(canvas);
    this.#view.footprint = this.#footprint;
    const { signal } = this.#listening;
    const on = (type, act) =>
      this.#view.addEventListener(type, ({ detail }) => act(detail), { signal });
    on("choose", (pose) => this.#chosen(pose));
    on("pick", ({ place, point }) => this.#pick(place ?? this.#ghostAt(point)));
    on("turn", (ghost) => this.#haunt(ghost));
  }

  async #load() {
    try {
      const maps = await readMaps(this.#robot);
      const found = maps.find(({ robots }) => robots.length > 0) ?? null;
      const map = found && { ...found, places: this.#leftOf(found.places) };
      const earlier = maps.filter((one) => one !== found && one.places.length > 0);
      if (this.#listening.signal.aborted) return;
      setTextOrHide(this.#parts["map-none"], map ? "" : unknownText());
      this.#places.show(map, earlier);
      if (map && map.map !== this.#loaded) {
        this.#view.show(map, await readPicture(map));
        this.#pick(null);
        this.#loaded = map.map;
      }
      this.#view.places = map?.places ?? [];
      if (this.#picked?.number)
        this.#pick(map?.places.find(({ number }) => number === this.#picked.number) ?? null);
    } catch (error) {
      setTextOrHide(this.#parts["map-none"], error.message);
    }
  }

  /** Let the person choose a point of the map in this mode; the same mode again, or null, ends it. */
  #choose(mode) {
    if (IN_CONTROL.includes(mode) && !this.#mayRequest()) mode = null;
    if (mode !== null && this.#loaded === null) {
      const text = this.#parts["map-none"].textContent || gettext("The map is being loaded.");
      this.#notify({ level: "info", code: "map unknown", text });
      mode = null;
    }
    this.#mode = mode === this.#mode ? null : mode;
    if (this.#mode !== null) this.#pick(null);
    mark(this.#parts.map, "chooses", this.#mode);
    show(this.#parts["map-place"], this.#mode === "place");
    for (const name of MODES)
      this.#parts[`map-${name}`].setAttribute("aria-pressed", String(name === this.#mode));
    if (this.#view) this.#view.chooses = this.#mode !== null;
    // The button that was pressed is hidden now.
    if (this.#mode === "place") this.#parts.map.querySelector("canvas")?.focus();
    this.#speak();
  }

  /**
   * Offer to drive to the pressed place, or to where the ghost stands. The press alone sends no robot: it may be meant
   * to move the map.
   */
  #pick(picked) {
    if (picked?.number === undefined || picked.number !== this.#picked?.number)
      this.#pickedMs = performance.now();
    show(this.#parts["map-picked"], picked !== null);
    if (picked) this.#places.open(false);
    this.#haunt(picked);
    if (picked)
      setText(
        this.#parts["map-picked-go"],
        picked.name ? interpolate(gettext("Go to “%s”"), [picked.name]) : gettext("Go here"),
      );
    this.#speak();
  }

  /** Show the ghost at a pose; none for a named place, which has its own mark. */
  #haunt(picked) {
    this.#picked = picked;
    if (this.#view) this.#view.ghost = this.#isGhost ? picked : null;
  }

  get #isGhost() {
    return this.#picked !== null && this.#picked.number === undefined;
  }

  #leftOf(places) {
    return leftOf(this.#tasks, "places", places, ({ name }) => name);
  }

  #ghostAt(point) {
    if (!point || this.#loaded === null || limits(this.#tasks, "places")) return null;
    return { ...point, heading: this.#view.headingTo(point) };
  }

  #mayRequest() {
    if (!this.#mayAct) this.#notify({ level: "info", code: "map control", text: whyNotNow() });
    return this.#mayAct;
  }

  #chosen(pose) {
    const mode = this.#mode;
    if (mode === "pose" && !pose.isTurned)
      return this.#speak(gettext("Press, then drag to where the robot looks."));
    if (mode === "pose" && !this.#mayRequest()) return;
    this.#choose(null);
    if (mode === "place") this.#places.add(rounded(pose));
    else if (mode === "go") this.#pick({ x: pose.x, y: pose.y, heading: pose.heading });
    else this.#send({ t: "set_pose", ...rounded(pose), map: this.#loaded ?? "" });
  }

  /** Send a request. If the robot refuses it because it has another map by now, load that map. */
  async #send(request) {
    const refusal = await this.#request(request);
    if (refusal?.code === "map_changed") this.#load();
  }

  /** @param {object} there a named place, or the pose of the ghost */
  #goTo(there) {
    if (!this.#mayRequest()) return;
    this.#places.open(false);
    this.#pick(null);
    const here = { t: "go", ...rounded(there), map: this.#loaded ?? "" };
    this.#send(there.name ? goRequest(there) : here);
  }

  #speak(wanted = "") {
    const state = this.#newest?.state;
    const { location, navigation_held: held = "" } = state ?? {};
    const modes = {
      go: gettext("Press where the robot should go, drag to where it should look."),
      pose: gettext("Press where the robot is, drag to where it looks."),
      place: gettext("Press where the place is, drag to where a robot should look."),
    };
    if (this.#mode !== "pose") this.#wanted = "";
    else if (wanted) this.#wanted = wanted;
    // Without control, the robot's pose is not read: a missing pose does not mean that the robot is lost.
    const isLost = state && !location && isSeen(state) && this.#mayAct && this.#loaded !== null;
    const turns = this.#isGhost ? gettext("Drag it to where the robot should look.") : "";
    const words =
      this.#wanted ||
      (modes[this.#mode] ?? (held || location?.problem || (isLost ? lostText() : "") || turns));
    setText(this.#parts["map-words"], words);
    show(this.#parts["map-words"], words !== "");
  }
}

function lostText() {
  return gettext("The robot does not know where it is: press “Robot is here”, then its place.");
}

function unknownText() {
  return gettext("No map of this robot yet. It is read while somebody has control.");
}
