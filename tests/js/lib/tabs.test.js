import { afterEach, beforeEach, describe, expect, it } from "vitest";
import { Tabs, tabByKey, tabIn } from "../../../static/js/lib/tabs.js";

const NAMES = ["centre", "drive", "speech"];

describe("the tabs", () => {
  let root;
  let list;
  let tabs;
  let changes;
  const link = (name) => list.querySelector(`#tab-${name}`);
  const goTo = (hash) => {
    location.hash = hash;
    window.dispatchEvent(new Event("hashchange"));
  };

  beforeEach(() => {
    location.hash = "";
    root = document.createElement("main");
    list = document.createElement("div");
    for (const name of NAMES) {
      const tab = document.createElement("a");
      tab.setAttribute("role", "tab");
      tab.id = `tab-${name}`;
      tab.href = `#${name}`;
      list.append(tab);
    }
    document.body.append(list);
    tabs = new Tabs(root, list, document.createElement("div"));
    changes = [];
    tabs.addEventListener("change", ({ detail }) => changes.push(detail));
  });
  afterEach(() => {
    tabs.close();
    list.remove();
    location.hash = "";
  });

  it("begin with the tab in the address, else with the first", () => {
    tabs.begin();
    expect(root.dataset.tab).toBe("centre");
    expect(changes).toEqual([{ tab: "centre", before: null }]);
    expect(tabIn("#speech", NAMES)).toBe("speech");
    expect(tabIn("#main", NAMES)).toBeNull();
  });

  it("follow the address, and report the previous tab", () => {
    tabs.begin();
    goTo("#speech");
    expect(changes.at(-1)).toEqual({ tab: "speech", before: "centre" });
    expect(link("speech").getAttribute("aria-selected")).toBe("true");
    expect(link("centre").tabIndex).toBe(-1);
    goTo("#speech");
    expect(changes).toHaveLength(2);
  });

  it("change during the click, before the next key", () => {
    tabs.begin();
    const click = (more) =>
      link("drive").dispatchEvent(
        new MouseEvent("click", { bubbles: true, cancelable: true, detail: 1, ...more }),
      );
    expect(click({ ctrlKey: true })).toBe(true); // the browser opens the link in another tab
    expect(root.dataset.tab).toBe("centre");
    expect(click({})).toBe(false);
    expect(root.dataset.tab).toBe("drive");
    expect(location.hash).toBe("#drive");
    window.dispatchEvent(new Event("hashchange")); // the browser sends this event later
    expect(changes).toHaveLength(2);
  });

  it("tell the style sheet which tabs have the joystick", () => {
    link("centre").dataset.stick = "";
    tabs.begin();
    expect(root.dataset.stick).toBe("true");
    goTo("#drive");
    expect(root.dataset.stick).toBeUndefined();
  });

  it("stay where they are when the address names something else", () => {
    tabs.begin();
    goTo("#drive");
    goTo("#main");
    expect(root.dataset.tab).toBe("drive");
    expect(location.hash).toBe("#drive");
  });

  it("are changed by the arrows, which then drive nothing", () => {
    expect(tabByKey("ArrowRight", "speech", NAMES)).toBe("centre");
    expect(tabByKey("ArrowLeft", "centre", NAMES)).toBe("speech");
    expect(tabByKey("End", "centre", NAMES)).toBe("speech");
    expect(tabByKey("w", "centre", NAMES)).toBeNull();
    tabs.begin();
    let reached = false;
    const hear = () => {
      reached = true;
    };
    window.addEventListener("keydown", hear);
    const press = (key) =>
      link("centre").dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
    press("ArrowRight");
    expect(root.dataset.tab).toBe("drive");
    expect(location.hash).toBe("#drive");
    expect(document.activeElement).toBe(link("drive"));
    expect(reached).toBe(false);
    document.dir = "rtl";
    press("ArrowRight");
    document.dir = "";
    expect(root.dataset.tab).toBe("speech");
    press("w");
    expect(reached).toBe(true);
    window.removeEventListener("keydown", hear);
  });
});
