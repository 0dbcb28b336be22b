/**
 * A person's choice: plan, camera, both, 3D or the cells of the own layout; the main camera, and a small second one.
 * Kept per browser, but for the layout.
 */

import { CELLS, kindOf } from "../control/layout/cells.js";
import { make, mark, show } from "../lib/dom.js";
import { recall, remember } from "../lib/prefs.js";

const VIEWS = ["plan", "camera", "both", "scene"];
const WITHOUT_CAMERA = ["plan", "scene"];
const LARGE = { plan: ["plan"], camera: ["camera"], both: ["camera", "plan"], scene: ["scene"] };
const ROOMY_PX = 560; // a smaller picture is not divided, unless the person chose both

/** Return the first view: the chosen view; else both if there is room, or the camera. */
export function firstView(chosen, width, height) {
  if (VIEWS.includes(chosen)) return chosen;
  return Math.min(width, height) >= ROOMY_PX ? "both" : "camera";
}

/** Event: "change". */
export class Views extends EventTarget {
  #area;
  #parts;
  #cameras = [];
  #view = "plan";
  #main = null;
  #hasSecond = recall("camera-second", false);
  #isSwapped = false; // the camera's picture changed places with the small plan
  #cells = null; // contents of the own layout; null: there is none
  #isOwn = false; // the own layout is shown
  #listening = new AbortController();

  /** @param {HTMLElement} area gets data-view for the style sheet */
  constructor(area, parts) {
    super();
    this.#area = area;
    this.#parts = parts;
    const { signal } = this.#listening;
    const on = (name, type, act) => parts[name].addEventListener(type, act, { signal });
    on("views", "click", ({ target }) => this.#pick(target.closest("[data-view]")));
    on("camera-select", "change", ({ target }) => this.#turnTo(target.value));
    on("second-toggle", "click", () => this.#toggleSecond());
    on("second-swap", "click", () => this.#enlarge(this.second.name));
    on("plan-swap", "click", () => this.#shrink());
    on("view-open", "click", () => this.#open(!this.#isOpen));
    on("full-screen", "click", () => this.#open(false));
    document.addEventListener(
      "pointerdown",
      ({ target }) => {
        const isInside = parts["view-bar"].contains(target) || parts["view-open"].contains(target);
        if (!isInside) this.#open(false);
      },
      { signal },
    );
    on("picture-area", "keydown", (event) => {
      if (event.key !== "Escape" || !this.#isOpen) return;
      this.#open(false);
      parts["view-open"].focus();
    });
    this.#show();
  }

  /** @returns {"plan" | "camera" | "both" | "scene" | "own"} */
  get view() {
    return this.#isOwn ? "own" : this.#view;
  }

  /** @param {?string[]} cells contents of the own layout, which is shown from now on; null: there is none */
  set cells(cells) {
    if (String(cells) === String(this.#cells)) return;
    this.#cells = cells;
    this.#isOwn = cells !== null;
    this.#isSwapped = false;
    this.#changed();
  }

  /** Whether a content has a picture of its own: "plan", "camera", "second", "map", "scene" or "plot". */
  shows(content) {
    return (this.#isOwn ? this.#cells : LARGE[this.#view]).some((one) => kindOf(one) === content);
  }

  /** The camera that is shown large, or null. */
  get main() {
    return this.shows("camera") ? this.#main : null;
  }

  /** The camera that is shown small, or null. */
  get second() {
    if (this.#view === "plan" && this.#isSwapped) return this.#main;
    const isWanted = this.#isOwn ? this.shows("second") : this.main && this.#hasSecond;
    if (!isWanted || this.#cameras.length < 2) return null;
    const at = this.#cameras.indexOf(this.#main);
    return this.#cameras[(at + 1) % this.#cameras.length];
  }

  /**
   * @param {object[]} cameras of the robot: the first view shows a camera, unless the person chose the plan
   *   or 3D
   */
  set cameras(cameras) {
    this.#cameras = cameras;
    const wanted = this.#main?.name ?? recall("camera-main", null);
    this.#main = cameras.find(({ name }) => name === wanted) ?? cameras[0] ?? null;
    const { clientWidth, clientHeight } = this.#area;
    const isFirst = !Number(this.#area.dataset.cameras);
    if (isFirst) this.#view = firstView(recall("camera-view"), clientWidth, clientHeight);
    if (!this.#main && this.#view !== "scene") this.#view = "plan";
    mark(this.#area, "cameras", String(cameras.length));
    this.#parts["camera-select"].replaceChildren(
      ...cameras.map(({ name, label }) => {
        const option = make("option", { text: label });
        option.value = name;
        return option;
      }),
    );
    this.#changed();
  }

  close() {
    this.#listening.abort();
  }

  get #isOpen() {
    return this.#parts["view-open"].getAttribute("aria-expanded") === "true";
  }

  /** Open or close the bar of views. On a small screen, the open bar covers the picture. */
  #open(open) {
    this.#parts["view-open"].setAttribute("aria-expanded", String(open));
    mark(this.#parts["view-bar"], "open", open);
  }

  #pick(button) {
    if (!button) return;
    this.#isOwn = button.dataset.view === "own";
    this.#isSwapped = false;
    if (!this.#isOwn) {
      this.#view = button.dataset.view;
      remember("camera-view", this.#view);
    }
    this.#open(false);
    this.#changed();
  }

  /** The small picture and the large one change places. */
  #enlarge(name) {
    if (this.#isSwapped) this.#view = "camera";
    this.#isSwapped = false;
    this.#turnTo(name);
  }

  #shrink() {
    this.#view = "plan";
    this.#isSwapped = true;
    this.#changed();
  }

  #turnTo(name) {
    this.#main = this.#cameras.find((camera) => camera.name === name) ?? this.#main;
    remember("camera-main", this.#main.name);
    this.#parts["camera-select"].blur(); // so that keys drive again
    this.#changed();
  }

  #toggleSecond() {
    this.#hasSecond = !this.#hasSecond;
    remember("camera-second", this.#hasSecond);
    this.#changed();
  }

  #changed() {
    this.#show();
    this.dispatchEvent(new CustomEvent("change"));
  }

  #show() {
    const { views, second, "view-bar": bar, "view-open": opener } = this.#parts;
    const isKnown = Boolean(this.#area.dataset.cameras);
    show(bar, isKnown);
    show(opener, isKnown);
    mark(this.#area, "view", this.view);
    this.#place();
    for (const button of views.querySelectorAll("[data-view]")) {
      const { view } = button.dataset;
      button.setAttribute("aria-pressed", String(view === this.view));
      const isOffered = this.#main !== null || WITHOUT_CAMERA.includes(view);
      show(button, view === "own" ? this.#cells !== null : isOffered);
    }
    const many = this.#cameras.length > 1 && this.main !== null;
    show(this.#parts["camera-pick"], many);
    show(this.#parts["second-toggle"], many && !this.#isOwn);
    this.#parts["second-toggle"].setAttribute("aria-pressed", String(this.#hasSecond));
    this.#parts["camera-select"].value = this.#main?.name ?? "";
    show(this.#parts.camera, this.main !== null);
    show(this.#parts.snapshot, this.main !== null);
    show(second, this.second !== null);
  }

  /** Each content of the own layout gets its cell, for the style sheet; plots have theirs from `PlotCells`. */
  #place() {
    const cells = this.#isOwn ? this.#cells : [];
    mark(this.#area, "cells", cells.length || null);
    const { picture, camera, second, scene, map } = this.#parts;
    const places = { plan: picture.parentElement, camera, second, scene, map };
    for (const [content, element] of Object.entries(places))
      mark(element, "cell", CELLS[cells.indexOf(content)]);
  }
}
