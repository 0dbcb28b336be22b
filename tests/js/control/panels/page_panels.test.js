import { beforeAll, beforeEach, describe, expect, it, vi } from "vitest";
import { PagePanels } from "../../../../static/js/control/panels/page_panels.js";
import { PageState } from "../../../../static/js/control/panels/page_state.js";
import { parts } from "../../../../static/js/lib/dom.js";

/** A made-up kind of task: this class and its entry in the list are all that a page needs. */
class Dance {
  static hears = ["state.dance", "offers"];
  static task = "dance";
  static requests = {
    dance: { name: () => "Dance" },
    dance_cancel: { name: () => "End the dance", control: "optional" },
  };
  heard = [];
  undone = vi.fn();
  zero = vi.fn();
  close = vi.fn();

  constructor(page) {
    this.page = page;
    made.push(this);
  }

  set dance(dance) {
    this.heard.push(dance);
  }

  shows({ now }) {
    return now && { words: now.step, who: now.who, cancel: [{ t: "dance_cancel" }] };
  }

  sent() {
    return this.undone;
  }
}

class Broken {
  static hears = ["state.dance"];

  set dance(_) {
    throw new Error("a fault in one panel");
  }

  zero() {
    throw new Error("a fault in one panel");
  }
}

let made;
let state;
let panels;
let send;
let notify;

beforeEach(() => {
  made = [];
  document.body.innerHTML =
    '<section data-part="running"><div data-part="elsewhere"></div></section>';
  state = new PageState();
  send = vi.fn(() => true);
  notify = vi.fn();
  const page = { root: document.body, parts: parts(document), send, notify, clock: () => 40.5 };
  panels = new PagePanels([Broken, Dance], state, page);
});

const faults = vi.fn();

// As in a browser, a fault in a listener goes to the window.
beforeAll(() => {
  window.happyDOM.settings.disableErrorCapturing = false;
  window.addEventListener("error", faults);
  vi.spyOn(console, "error").mockImplementation(() => {});
});

const WALTZ = { step: "Waltz", who: "Ann" };
const view = (dance, ended = null) => ({ state: { dance, dance_ended: ended }, scan: null });

describe("a panel of the list", () => {
  it("hears of its task, also after another panel failed", () => {
    state.tellView(view(WALTZ));
    state.tellView(view(null, { outcome: "done" }));
    expect(made[0].heard).toEqual([
      { now: WALTZ, ended: null },
      { now: null, ended: { outcome: "done" } },
    ]);
    expect(faults).toHaveBeenCalledTimes(2);
  });

  it("has a row while its task runs, with Cancel", () => {
    state.tell({ fence: null, mayAct: false, mayCancel: true });
    state.tellView(view(WALTZ));
    expect(document.querySelector("[data-part=dance-words]").textContent).toBe("Waltz");
    document.querySelector("[data-part=dance-cancel]").click();
    expect(send).toHaveBeenCalledWith({ t: "dance_cancel", seq: 41 });
  });

  it("learns of its requests, and of a refusal", async () => {
    state.tell({ fence: 7 });
    const answers = [made[0].page.request({ t: "dance" }), made[0].page.request({ t: "dance" })];
    panels.receive({ t: "accepted", of: "dance", seq: 41 });
    const refusal = { code: "busy", text: "It dances." };
    panels.receive({ t: "refused", of: "dance", seq: 42, refusal });
    expect(await Promise.all(answers)).toEqual([null, refusal]);
    expect(made[0].undone).toHaveBeenCalledOnce();
    expect(notify.mock.calls.map(([{ text }]) => text)).toEqual(["Dance: It dances."]);
  });

  it("ends with the page", () => {
    panels.zero();
    panels.close();
    state.close();
    state.tell({ offers: {} });
    state.tellView(view(WALTZ));
    expect([made[0].zero, made[0].close].map(({ mock }) => mock.calls.length)).toEqual([1, 1]);
    expect(made[0].heard).toEqual([]);
  });
});
