/** The 3D view in the picture area: loads its module when first opened, and shows why it cannot draw. */

import { make, mark, setTextOrHide, show } from "../lib/dom.js";

const MAP_EVERY = 5; // times AGAIN_MS: the robot may have another map
const DESCRIPTION_EVERY = 15; // times AGAIN_MS: the robot may have been started again
const AGAIN_MS = 4_000; // between two checks, while the view is open

export class ScenePanel {
  static hears = ["facts", "view", "go_path", "stale", "sceneShown"];
  #parts;
  #robot; // its address
  #send;
  #load;
  #scene = null; // made when the view is first opened
  #opens = false;
  #facts = null;
  #newest = null;
  #path = [];
  #isDescribed = false; // the newest description has been read
  #tag = ""; // ETag of the newest description
  #digest; // of the description that is drawn; null: there is none; undefined: not asked yet
  #map = null; // number of the map that is drawn
  #looks = 0;
  #timer = null;
  #abort = null; // aborts the running requests
  #listening = new AbortController();

  /**
   * @param {import("../control/panels/page_panels.js").Page} page
   * @param {(address: string) => Promise<object>} load the module
   */
  constructor({ root, parts, send }, load = (address) => import(address)) {
    this.#parts = parts;
    this.#robot = `/api/v1/robots/${root.dataset.robot}`;
    this.#send = send;
    this.#load = load;
    parts["scene-modes"].addEventListener(
      "click",
      ({ target }) => this.#choose(target.closest("[data-mode]")?.dataset.mode),
      { signal: this.#listening.signal },
    );
  }

  /** @param {boolean} opens whether the view is shown from now on */
  set sceneShown(opens) {
    if (opens === this.#opens) return;
    this.#opens = opens;
    show(this.#parts.scene, opens);
    this.#requestJoints();
    clearTimeout(this.#timer);
    this.#abort?.abort();
    if (this.#scene) this.#scene.shown = opens;
    this.#isDescribed = false;
    if (opens) this.#begin();
  }

  /** The robot's facts; they are set again after each connection. */
  set facts(facts) {
    this.#facts = facts;
    if (this.#scene) this.#scene.facts = facts;
    if (this.#opens) this.#requestJoints();
  }

  set view(view) {
    this.#newest = view;
    if (this.#opens && this.#scene) this.#scene.view = view;
  }

  /** @param {{path_cm: number[]}} message the planned path: flat x, y in the frame of the map */
  set go_path({ path_cm: path }) {
    this.#path = path;
    if (this.#scene) this.#scene.path = path;
  }

  /** Whether the view is out of date. */
  set stale(stale) {
    mark(this.#parts.scene, "old", stale);
    if (stale) this.#isDescribed = false; // the robot may come back with another description
  }

  gone() {
    this.go_path = { path_cm: [] };
  }

  close() {
    this.#listening.abort();
    this.#abort?.abort();
    clearTimeout(this.#timer);
    this.#scene?.close();
  }

  #requestJoints() {
    if (this.#facts) this.#send({ t: "show_joints", wanted: this.#opens });
  }

  async #begin() {
    const abort = new AbortController();
    this.#abort = abort;
    try {
      if (!this.#scene) await this.#make(abort.signal);
    } catch {
      if (!abort.signal.aborted)
        this.#showText(gettext("The 3D view could not be loaded. Choose it again."));
      return;
    }
    if (abort.signal.aborted || !this.#scene) return;
    this.#scene.shown = true;
    this.#feed();
    this.#follow(abort.signal);
  }

  async #make(signal) {
    this.#showText(gettext("The 3D view is being loaded."));
    const { SceneView } = await this.#load(this.#parts.scene.dataset.sceneModule);
    if (signal.aborted || this.#scene) return;
    const scene = new SceneView(this.#parts["scene-place"], this.#parts.scene.dataset.help);
    scene.addEventListener("words", ({ detail }) => this.#showText(detail));
    scene.addEventListener("notes", ({ detail }) => this.#note(detail));
    scene.addEventListener("mode", ({ detail }) => this.#show(detail));
    this.#scene = scene;
    this.#parts.scene.scene = scene; // for tests, and for a browser's developer tools
    this.#showText(scene.begin() ? gettext("The robot’s description is being read.") : scene.words);
    this.#show(scene.mode);
  }

  #feed() {
    if (this.#facts) this.#scene.facts = this.#facts;
    if (this.#newest) this.#scene.view = this.#newest;
    this.#scene.path = this.#path;
  }

  /** Reads description and map, again and again while the view is open: either may be missing, or change. */
  async #follow(signal) {
    if (!this.#scene.draws) return;
    if (this.#looks % DESCRIPTION_EVERY === 0) this.#isDescribed = false;
    if (!this.#isDescribed) this.#isDescribed = await this.#readDescription(signal);
    const isOnMap = Boolean(this.#newest?.state.location);
    if (isOnMap && (this.#map === null || this.#looks % MAP_EVERY === 0))
      await this.#readMap(signal);
    this.#looks += 1;
    if (!signal.aborted) this.#timer = setTimeout(() => this.#follow(signal), AGAIN_MS);
  }

  async #readDescription(signal) {
    try {
      const headers = this.#tag ? { "If-None-Match": this.#tag } : {};
      const answer = await fetch(`${this.#robot}/description`, { signal, headers });
      const isKnown = answer.status === 304;
      const found = isKnown ? { digest: this.#digest } : await answer.json();
      if (signal.aborted) return false;
      if (!answer.ok && !isKnown) {
        const isGone = answer.status === 404 || answer.status === 409;
        if (this.#digest !== null && !isGone) return false; // a temporary error: the robot is still drawn
        if (this.#digest !== null) this.#scene.describe(null);
        this.#digest = null;
        this.#tag = "";
        this.#showText(found.detail ?? "");
        return false;
      }
      this.#showText("");
      this.#tag = answer.headers.get("ETag") ?? "";
      if (found.digest === this.#digest) return true;
      this.#digest = found.digest;
      this.#scene.describe(found);
      return true;
    } catch (error) {
      if (error.name !== "AbortError")
        this.#showText(gettext("The robot’s description could not be read."));
      return false;
    }
  }

  async #readMap(signal) {
    try {
      const answer = await fetch(`${this.#robot}/map`, { signal });
      if (!answer.ok) return;
      const map = await answer.json();
      if (map.number === this.#map) return;
      const picture = new Image();
      picture.src = map.picture;
      await picture.decode();
      if (signal.aborted) return;
      this.#map = map.number;
      this.#scene.showMap(map, picture);
    } catch {
      // the view works without a map, and tries again
    }
  }

  #choose(mode) {
    if (mode && this.#scene) this.#scene.mode = mode;
  }

  #show(mode) {
    for (const button of this.#parts["scene-modes"].querySelectorAll("[data-mode]"))
      button.setAttribute("aria-pressed", String(button.dataset.mode === mode));
  }

  #showText(words) {
    setTextOrHide(this.#parts["scene-words"], words);
  }

  /** @param {string[]} notes differences from the real robot, as texts */
  #note(notes) {
    const { "scene-notes": list, "scene-more": more } = this.#parts;
    show(more, notes.length > 0);
    more.querySelector("summary").textContent = interpolate(
      ngettext("%s note", "%s notes", notes.length),
      [notes.length],
    );
    list.replaceChildren(...notes.map((text) => make("li", { text })));
  }
}
