/** The newest facts of a control page: panels subscribe to them by name. */

const FIELD = "state.";

/** Return a task of the robot's state: what runs now, and the last end; null: none. Other fields as they are. */
function fieldOf(state, name) {
  const end = `${name}_ended`;
  return end in state ? { now: state[name], ended: state[end] } : state[name];
}

/**
 * Names: `state.motion` and so on, for each field of the robot's state (see `fieldOf`); `state`, `view`; a message
 * of the console by its `t`, such as `offers`; and of the page: `facts` of the robot, `stale` (the view may be
 * out of date), `role` of the person, `tasks` that a lesson leaves to the person (null: all), `fence` of this tab's control, `mayAct` (this tab has control; null: not
 * known yet), `mayCancel` (so may supervisors without control), `tab`, `cells` (contents of the own layout),
 * `sceneShown`, `mapShown` and `plotShown`, `plotted` (the new content of a plot's cell). Calls of panels, too: see `PagePanels`.
 *
 * Each is an event: an error in one panel does not keep the news from the others.
 */
export class PageState extends EventTarget {
  #fields = new Set(); // of the robot's state, in the order of subscription
  #listening = new AbortController();

  /** @param {string} name @param {(value: any) => void} hear gets each new value */
  on(name, hear) {
    if (name.startsWith(FIELD)) this.#fields.add(name.slice(FIELD.length));
    const { signal } = this.#listening;
    this.addEventListener(name, ({ detail }) => hear(detail), { signal });
  }

  /** @param {object} panel has a setter for each of the names; for `state.motion` it is `motion` */
  subscribe(panel, names) {
    for (const name of names) {
      const setter = name.replace(FIELD, "");
      this.on(name, (value) => {
        panel[setter] = value;
      });
    }
  }

  /** @param {Object<string, any>} news values by name */
  tell(news) {
    for (const [name, detail] of Object.entries(news))
      this.dispatchEvent(new CustomEvent(name, { detail }));
  }

  /** @param {{state: object, scan: ?object}} view of the robot */
  tellView(view) {
    const { state } = view;
    this.tell({ view, state });
    for (const name of this.#fields)
      if (name in state) this.tell({ [FIELD + name]: fieldOf(state, name) });
  }

  close() {
    this.#listening.abort();
  }
}
