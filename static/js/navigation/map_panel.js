/** The panel "Map" over the picture: opens, loads the robot's map, and sends goals and poses that are chosen on it. */

import { make, mark, say, sayOrHide, show } from "../lib/dom.js";
import { MapView } from "./map_view.js";
import { endText } from "./words.js";

const LOOK_MS = 2_000; // while it is open and there is no map yet
const AGAIN_EVERY = 10; // looks: the map may be another one
const ZOOM = 1.5;

export class MapPanel {
  #root;
  #parts;
  #address;
  #order;
  #tell;
  #view = null; // made when it is first opened
  #mode = null; // "go", "pose" or null
  #drives = false;
  #path = [];
  #newest = null;
  #ended; // number of the last end that is known; undefined before the first state
  #loaded = null; // number of the map that is shown
  #timer = null;
  #listening = new AbortController();

  /**
   * @param {HTMLElement} root the area of the picture
   * @param {Record<string, HTMLElement>} parts
   * @param {string} address of the map
   * @param {{order: (order: object) => Promise<?object>, tell: (notice: object) => void}} page
   */
  constructor(root, parts, address, { order, tell }) {
    this.#root = root;
    this.#parts = parts;
    this.#address = address;
    this.#order = order;
    this.#tell = tell;
    const { signal } = this.#listening;
    const on = (part, act) => parts[part].addEventListener("click", act, { signal });
    on("map-open", () => this.#open(parts.map.hidden));
    on("map-go", () => this.#choose("go"));
    on("map-pose", () => this.#choose("pose"));
    on("map-in", () => this.#view.zoom(ZOOM));
    on("map-out", () => this.#view.zoom(1 / ZOOM));
    on("map-fit", () => this.#view.fit());
  }

  /** @param {{state: object, scan: ?object}} view of the robot */
  set view(view) {
    this.#newest = view;
    const { location = null, going_ended: ended = null } = view.state;
    show(this.#parts["map-open"], location !== null || !this.#parts.map.hidden);
    this.#followEnd(ended);
    if (this.#parts.map.hidden) return;
    this.#view.view = view;
    this.#speak();
  }

  set path(path) {
    this.#path = path;
    if (this.#view) this.#view.path = path;
  }

  /** @param {boolean} drives this tab has control */
  set drives(drives) {
    this.#drives = drives;
    if (!drives) this.#choose(null);
  }

  close() {
    this.#listening.abort();
    clearInterval(this.#timer);
    this.#view?.close();
  }

  #open(opens) {
    show(this.#parts.map, opens);
    mark(this.#root, "mapped", opens);
    this.#parts["map-open"].setAttribute("aria-expanded", String(opens));
    clearInterval(this.#timer);
    if (!opens) return this.#choose(null);
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
    this.#view.addEventListener("choose", ({ detail }) => this.#chosen(detail), {
      signal: this.#listening.signal,
    });
  }

  async #load() {
    try {
      const answer = await fetch(this.#address, { signal: this.#listening.signal });
      const map = await answer.json();
      if (!answer.ok) return sayOrHide(this.#parts["map-none"], map.detail ?? "");
      sayOrHide(this.#parts["map-none"], "");
      if (map.number === this.#loaded) return;
      const picture = new Image();
      picture.src = `${map.picture}?${map.number}`;
      await picture.decode();
      this.#loaded = map.number;
      this.#view.show(map, picture);
    } catch (error) {
      if (error.name !== "AbortError")
        sayOrHide(this.#parts["map-none"], gettext("The map could not be read."));
    }
  }

  /** Choose a place for this from now on; the same again: no more. */
  #choose(mode) {
    if (mode && !this.#drives) {
      this.#tell({ level: "info", code: "map control", text: gettext("Take control first.") });
      mode = null;
    }
    this.#mode = mode === this.#mode ? null : mode;
    for (const name of ["go", "pose"])
      this.#parts[`map-${name}`].setAttribute("aria-pressed", String(name === this.#mode));
    if (this.#view) this.#view.chooses = this.#mode !== null;
    this.#speak();
  }

  #chosen({ x, y, heading }) {
    const t = this.#mode === "pose" ? "set_pose" : "go";
    this.#choose(null);
    const rounded = (value) => Math.round(value * 1000) / 1000;
    this.#order({ t, x: rounded(x), y: rounded(y), heading: rounded(heading) });
  }

  #speak() {
    const { location = null, navigation_held: held = "" } = this.#newest?.state ?? {};
    const modes = {
      go: gettext("Press where the robot should go, and drag to where it should look."),
      pose: gettext("Press where the robot is, and drag to where it looks."),
    };
    const words = modes[this.#mode] ?? (held || location?.problem || "");
    say(this.#parts["map-words"], words);
    show(this.#parts["map-words"], words !== "");
  }

  #followEnd(ended) {
    const number = ended ? `${ended.fence} ${ended.seq}` : "";
    const known = this.#ended;
    this.#ended = number;
    if (known === undefined || number === known || !ended) return;
    const level = ["arrived", "cancelled", "replaced"].includes(ended.outcome)
      ? "success"
      : "warning";
    this.#tell({ level, code: `go ${number}`, text: endText(ended) });
  }
}
