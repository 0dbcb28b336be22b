/** The panels of a control page: made from their list, subscribed, given their answers, closed together. */

import { Running } from "../../tasks/running.js";
import { TaskRequests } from "../../tasks/tasks.js";

/**
 * The parts of the page that a panel gets.
 *
 * @typedef {object} Page
 * @property {HTMLElement} root
 * @property {Record<string, HTMLElement>} parts
 * @property {(request: object) => Promise<?object>} request sends a task; returns the refusal or null
 * @property {(message: object) => boolean} send sends any other message
 * @property {(notice: object) => void} notify
 * @property {(news: object) => void} tell tells other panels, see `PageState`
 * @property {import("../choices.js").Choices} choices of the person
 * @property {() => number} clock milliseconds; a reload of the tab does not set it back
 * @property {() => boolean} steers whether keys drive the robot now
 */

/**
 * The class of a panel, which is made with a `Page`. Each part is optional.
 *
 * @typedef {object} PanelKind
 * @property {string[]} hears names of `PageState`: the panel has a setter for each
 * @property {Object<string, import("../../tasks/tasks.js").RequestKind>} requests by their `t`
 * @property {string} task field of the robot's state: its task, which has a row while it runs, see `Running`
 *
 * Methods of the panel: `shows(task)` and `line` for that row; `sent(request)`: one of its requests was sent, by
 * any panel (returns a function that undoes this call after a refusal); `zero()`: end input that goes on by
 * itself; `silent()`: the robot is out of reach; `gone()`: so is its bridge; `close()`.
 */

const CALLS = ["zero", "silent", "gone"];

export class PagePanels {
  #state;
  #requests;
  #panels = [];
  #owners = new Map(); // the panel of each kind of request

  /**
   * @param {PanelKind[]} kinds in the order in which they hear news and show running tasks
   * @param {import("./page_state.js").PageState} state
   * @param {Omit<Page, "request" | "tell">} page
   */
  constructor(kinds, state, page) {
    this.#state = state;
    const requests = Object.assign({}, ...kinds.map((kind) => kind.requests));
    this.#requests = new TaskRequests(page.send, page.notify, Math.floor(page.clock()), requests);
    const request = (message) => this.request(message);
    const given = { ...page, request, tell: (news) => state.tell(news) };
    const running = new Running(page.parts, request, requests);
    state.subscribe(this.#requests, ["fence", "stale"]);
    for (const Kind of kinds) {
      const panel = new Kind(given);
      this.#panels.push(panel);
      state.subscribe(panel, Kind.hears ?? []);
      for (const call of CALLS) if (panel[call]) state.on(call, () => panel[call]());
      for (const t of Object.keys(Kind.requests ?? {})) this.#owners.set(t, panel);
      if (Kind.task) state.on(`state.${Kind.task}`, running.row(Kind.task, panel));
    }
    state.subscribe(running, ["mayAct", "mayCancel", "state.chosen", "tab", "ghost"]);
    this.#panels.push(this.#requests);
  }

  /**
   * Send a request; its panel learns of it.
   * @returns {Promise<?object>} the refusal; null if it was accepted
   */
  async request(request) {
    const undo = this.#owners.get(request.t).sent?.(request);
    const refusal = await this.#requests.send(request);
    if (refusal && refusal.code !== "no_answer") undo?.();
    return refusal;
  }

  /** @returns {boolean} whether the message was an answer to a request */
  receive(message) {
    return this.#requests.receive(message);
  }

  /** End all input that goes on by itself. */
  zero() {
    this.#state.tell({ zero: true });
  }

  /** The connection is lost. */
  lost() {
    this.#requests.lost();
    this.#state.tell({ silent: true });
  }

  /** The console has lost the robot's bridge. */
  gone() {
    this.#state.tell({ silent: true, gone: true });
  }

  close() {
    for (const panel of this.#panels) panel.close?.();
  }
}
