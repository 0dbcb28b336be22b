/**
 * A person's layout of the page at a desk: the pictures side by side, what is shown beside them, and the places of the
 * panels. Kept for each account and robot. Without one, the page shows its own views.
 */

import { make, mark, show } from "../../lib/dom.js";
import { contentsOf, isPlot, kindOf, NEW_PLOT, placed, resized } from "./cells.js";
import { orderOf, Panels, STANDARD_ORDER } from "./panels.js";
import { SharedLayouts } from "./shared_layouts.js";

const DESK = "(min-width: 68.75em) and (min-height: 40em)"; // smaller windows have their fixed layouts
const STANDARD = { cells: [], side: true, stick: true, panels: STANDARD_ORDER };

function contentName(content) {
  return {
    camera: gettext("Camera"),
    plan: gettext("Plan"),
    map: gettext("Map"),
    scene: gettext("3D"),
    second: gettext("Second camera"),
    plot: gettext("Plot"),
  }[kindOf(content)];
}

export class Arrange {
  static hears = ["facts", "role", "tab", "plotted"];
  #root;
  #parts;
  #choices;
  #tell;
  #layout;
  #offered = null; // contents that the robot has; null: not known yet
  #panels;
  #shared;
  #desk = matchMedia(DESK);
  #listening = new AbortController();

  /** @param {import("../panels/page_panels.js").Page} page */
  constructor({ root, parts, choices, notify, tell }) {
    this.#root = root;
    this.#parts = parts;
    this.#choices = choices;
    this.#tell = tell;
    this.#layout = this.#recalled();
    this.#panels = new Panels(root, notify);
    this.#shared = new SharedLayouts(parts, root.dataset.layouts, () => this.#layout);
    const { signal } = this.#listening;
    const on = (target, type, act) => target.addEventListener(type, act, { signal });
    on(this.#desk, "change", () => this.#follow());
    on(document, "fullscreenchange", () => this.#follow());
    on(this.#panels, "move", ({ detail }) => this.#choose({ panels: detail }));
    on(parts["arrange-open"], "click", () => this.#open(parts.arrange.hidden));
    on(parts["arrange-close"], "click", () => this.#open(false));
    on(parts.arrange, "keydown", (event) => event.key === "Escape" && this.#open(false));
    on(parts["arrange-count"], "click", ({ target }) => this.#resize(target.dataset.count));
    on(parts["arrange-cells"], "change", ({ target }) => this.#put(target));
    on(parts["arrange-side"], "change", ({ target }) => this.#choose({ side: target.checked }));
    on(parts["arrange-stick"], "change", ({ target }) => this.#choose({ stick: target.checked }));
    on(this.#shared, "choose", ({ detail }) => this.#choose(detail));
    on(parts["arrange-reset"], "click", () => this.#choose(STANDARD));
    this.#follow();
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

  /** @param {{at: number, content: string}} plotted the person chose topic or fields of the plot in a cell */
  set plotted({ at, content }) {
    this.#choose({ cells: this.#cells.with(at, content) });
  }

  close() {
    this.#listening.abort();
    this.#panels.close();
    this.#shared.close();
  }

  get #key() {
    return `layout ${this.#root.dataset.robot}`;
  }

  /** The layout as it was kept. The places of the panels were once the same on all robots. */
  #recalled() {
    const { layout = "{}" } = this.#choices.recall(this.#key, {});
    const panels = orderOf(this.#choices.recall("panels", {}));
    return { ...STANDARD, panels, ...JSON.parse(layout) };
  }

  /** The cells that this robot can fill. */
  get #cells() {
    const offered = this.#offered;
    const { cells } = this.#layout;
    return offered ? cells.filter((one) => isPlot(one) || offered.includes(one)) : [];
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
      this.#choose({ cells: resized(this.#cells, Number(count), this.#offered ?? []) });
  }

  #put(select) {
    this.#choose({ cells: placed(this.#cells, Number(select.dataset.at), select.value) });
    this.#parts.arrange.querySelector(`[data-at="${select.dataset.at}"]`).blur(); // so that keys drive again
  }

  /** @param {object} changes parts of a layout; a shared one has more fields */
  #choose({
    cells = this.#layout.cells,
    side = this.#layout.side,
    stick = this.#layout.stick,
    panels = this.#layout.panels,
  }) {
    this.#layout = { cells, side, stick, panels };
    const { robot } = this.#root.dataset;
    this.#choices.remember(this.#key, { robot, layout: JSON.stringify(this.#layout) });
    this.#follow();
  }

  #follow() {
    const cells = this.#cells;
    const hasRoom = this.#hasRoom;
    const { side, stick, panels } = this.#layout;
    this.#panels.order = panels;
    this.#tell({ cells: hasRoom && cells.length > 0 ? cells : null });
    mark(this.#root, "lists", hasRoom && !side ? "hidden" : null);
    mark(this.#root, "joystick", hasRoom && !stick ? "hidden" : null);
    this.#show(cells);
  }

  #show(cells) {
    const { "arrange-count": counts, "arrange-cells": places } = this.#parts;
    for (const button of counts.querySelectorAll("[data-count]"))
      button.setAttribute("aria-pressed", String(Number(button.dataset.count) === cells.length));
    this.#parts["arrange-side"].checked = this.#layout.side;
    this.#parts["arrange-stick"].checked = this.#layout.stick;
    mark(places, "cells", cells.length || null);
    show(places, cells.length > 0);
    places.replaceChildren(...cells.map((content, at) => this.#select(content, at)));
  }

  #select(chosen, at) {
    const options = [...this.#offered, isPlot(chosen) ? chosen : NEW_PLOT].map((content) => {
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
