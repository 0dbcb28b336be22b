/**
 * A person's layout of the page at a desk: the pictures side by side, and whether the lists beside them are shown. Kept
 * for each account and robot. Without one, the page shows its own views.
 */

import { make, mark, show } from "../../lib/dom.js";
import { contentsOf, placed, resized } from "./cells.js";
import { SharedLayouts } from "./shared_layouts.js";

const DESK = "(min-width: 68.75em) and (min-height: 40em)"; // smaller windows have their fixed layouts
const STANDARD = { cells: [], side: true };

function contentName(content) {
  return {
    camera: gettext("Camera"),
    plan: gettext("Plan"),
    map: gettext("Map"),
    scene: gettext("3D"),
    second: gettext("Second camera"),
    plot: gettext("Plot"),
  }[content];
}

export class Arrange {
  static hears = ["facts", "role", "tab"];
  #root;
  #parts;
  #choices;
  #tell;
  #layout;
  #offered = [];
  #shared;
  #desk = matchMedia(DESK);
  #listening = new AbortController();

  /** @param {import("../panels/page_panels.js").Page} page */
  constructor({ root, parts, choices, tell }) {
    this.#root = root;
    this.#parts = parts;
    this.#choices = choices;
    this.#tell = tell;
    this.#layout = layoutOf(choices.recall(this.#key, {}));
    this.#shared = new SharedLayouts(parts, root.dataset.layouts, () => this.#layout);
    const { signal } = this.#listening;
    const on = (target, type, act) => target.addEventListener(type, act, { signal });
    on(this.#desk, "change", () => this.#follow());
    on(document, "fullscreenchange", () => this.#follow());
    on(parts["arrange-open"], "click", () => this.#open(parts.arrange.hidden));
    on(parts["arrange-close"], "click", () => this.#open(false));
    on(parts.arrange, "keydown", (event) => event.key === "Escape" && this.#open(false));
    on(parts["arrange-count"], "click", ({ target }) => this.#resize(target.dataset.count));
    on(parts["arrange-cells"], "change", ({ target }) => this.#put(target));
    on(parts["arrange-side"], "change", ({ target }) => this.#choose({ side: target.checked }));
    on(this.#shared, "choose", ({ detail: { cells, side } }) => this.#choose({ cells, side }));
    on(parts["arrange-reset"], "click", () => this.#reset());
  }

  /** @param {object} facts of the robot: its cameras, and whether it has a map */
  set facts(facts) {
    this.#offered = contentsOf(facts);
    this.#follow();
  }

  /** @param {string} role of the person: supervisors share layouts */
  set role(role) {
    this.#shared.role = role;
  }

  /** Another tab is shown: some have no room for cells. */
  set tab(_tab) {
    this.#follow();
  }

  close() {
    this.#listening.abort();
    this.#shared.close();
  }

  get #key() {
    return `layout ${this.#root.dataset.robot}`;
  }

  /** The cells that this robot can fill. */
  get #cells() {
    return this.#layout.cells.filter((content) => this.#offered.includes(content));
  }

  get #hasRoom() {
    return this.#desk.matches && !document.fullscreenElement && Boolean(this.#root.dataset.stick);
  }

  #open(opens) {
    show(this.#parts.arrange, opens);
    this.#parts["arrange-open"].setAttribute("aria-expanded", String(opens));
    const part = opens ? "arrange-close" : "arrange-open";
    this.#parts[part].focus();
    if (opens) this.#shared.read();
  }

  #resize(count) {
    if (count !== undefined)
      this.#choose({ cells: resized(this.#cells, Number(count), this.#offered) });
  }

  #put(select) {
    this.#choose({ cells: placed(this.#cells, Number(select.dataset.at), select.value) });
    this.#parts.arrange.querySelector(`[data-at="${select.dataset.at}"]`).blur(); // so that keys drive again
  }

  #reset() {
    this.#choose(STANDARD);
    this.#tell({ layoutReset: true });
  }

  #choose(changes) {
    this.#layout = { ...this.#layout, ...changes };
    const { cells, side } = this.#layout;
    const { robot } = this.#root.dataset;
    this.#choices.remember(this.#key, { robot, cells: cells.join(), side: String(side) });
    this.#follow();
  }

  #follow() {
    const cells = this.#cells;
    const hasRoom = this.#hasRoom;
    this.#tell({ cells: hasRoom && cells.length > 0 ? cells : null });
    mark(this.#root, "lists", hasRoom && !this.#layout.side ? "hidden" : null);
    this.#show(cells);
  }

  #show(cells) {
    const { "arrange-count": counts, "arrange-cells": places, "arrange-side": side } = this.#parts;
    for (const button of counts.querySelectorAll("[data-count]")) {
      const count = Number(button.dataset.count);
      button.setAttribute("aria-pressed", String(count === cells.length));
      show(button, count <= this.#offered.length);
    }
    side.checked = this.#layout.side;
    mark(places, "cells", cells.length || null);
    show(places, cells.length > 0);
    places.replaceChildren(...cells.map((content, at) => this.#select(content, at)));
  }

  #select(chosen, at) {
    const options = this.#offered.map((content) => {
      const option = make("option", { text: contentName(content) });
      option.value = content;
      return option;
    });
    const select = make("select", { data: { at }, children: options });
    select.value = chosen;
    select.setAttribute("aria-label", interpolate(gettext("Picture %s"), [at + 1]));
    return select;
  }
}

/** Read a layout as it is kept. */
function layoutOf({ cells = "", side = "true" }) {
  return { cells: cells ? cells.split(",") : [], side: side !== "false" };
}
