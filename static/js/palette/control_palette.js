/** The palette of the control page: also what the robot can do. */

import { motions } from "./motions.js";
import { opensPalette } from "./opener.js";
import { pages } from "./pages.js";
import { Palette } from "./palette.js";
import { phrases } from "./phrases.js";
import { places } from "./places.js";
import { robots } from "./robots.js";

/**
 * The parts of the control page that sources of entries get.
 *
 * @typedef {object} Driving
 * @property {DOMStringMap} data of the page
 * @property {() => object} offers of the robot
 * @property {() => ?object} tasks that the present lesson leaves; null: all
 * @property {() => boolean} mayAct whether this tab has control of a robot that reports
 * @property {() => boolean} hasMap
 * @property {(request: object) => Promise<?object>} request as the page's buttons send it
 */

export class ControlPalette {
  static hears = ["facts", "offers", "tasks", "mayAct"];
  #palette;
  #offers = {};
  #tasks = null;
  #mayAct = false;
  #hasMap = false;
  #listening = new AbortController();

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ root, parts, request }) {
    const driving = {
      data: root.dataset,
      offers: () => this.#offers,
      tasks: () => this.#tasks,
      mayAct: () => this.#mayAct,
      hasMap: () => this.#hasMap,
      request,
    };
    const label = gettext("Search motions, phrases, places, robots and pages");
    this.#palette = new Palette(root, label, [
      () => motions(driving),
      () => phrases(driving),
      () => places(driving),
      () => robots(root.dataset.robot),
      pages,
    ]);
    const { signal } = this.#listening;
    opensPalette(parts["palette-open"], () => this.#palette.toggle(), signal);
  }

  /** @param {object} facts of the robot */
  set facts({ has_map: hasMap = false }) {
    this.#hasMap = hasMap;
  }

  /** @param {object} offers of the robot */
  set offers(offers) {
    this.#offers = offers;
    this.#palette.refresh();
  }

  /** @param {?object} tasks that the present lesson leaves; null: all */
  set tasks(tasks) {
    this.#tasks = tasks;
    this.#palette.refresh();
  }

  /** @param {?boolean} may whether this tab has control; null: not known yet */
  set mayAct(may) {
    if (this.#mayAct === Boolean(may)) return;
    this.#mayAct = Boolean(may);
    this.#palette.refresh();
  }

  close() {
    this.#listening.abort();
    this.#palette.close();
  }
}
