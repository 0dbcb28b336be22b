import { beforeEach, describe, expect, it, vi } from "vitest";
import { matches, SearchList } from "../../../static/js/lib/list.js";

describe("a search", () => {
  it("ignores case, accents and the order of words", () => {
    expect(matches("Buenos días", "DIAS buenos")).toBe(true);
    expect(matches("İyi günler", "gunler")).toBe(true);
    // A browser set to Turkish does this.
    vi.spyOn(String.prototype, "toLocaleLowerCase").mockImplementation(() => "ınspect");
    expect(matches("Inspect surroundings", "inspect")).toBe(true);
    vi.restoreAllMocks();
    expect(matches("/scan sensor_msgs/LaserScan", "laser scan")).toBe(true);
    expect(matches("wave", "bow")).toBe(false);
    expect(matches("wave", "")).toBe(true);
  });
});

describe("a searchable list", () => {
  let root;
  let act;
  let list;
  let field;

  const shown = () =>
    [...root.querySelectorAll("li")].filter((row) => !row.hidden).map((row) => row.textContent);
  const type = (text) => {
    field.value = text;
    field.dispatchEvent(new Event("input"));
  };
  const press = (key) =>
    field.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));

  beforeEach(() => {
    root = document.createElement("div");
    act = vi.fn();
    list = new SearchList(root, {
      label: "Search",
      text: ({ name }) => name,
      isOff: ({ off }) => off === true,
      act,
    });
    list.items = [{ name: "wave" }, { name: "bow" }, { name: "über", off: true }];
    field = root.querySelector("input");
  });

  it("shows hits while typing, and says when there are none", () => {
    type("w");
    expect(shown()).toEqual(["wave", "bow"]);
    type("x");
    expect(shown()).toEqual([]);
    expect(root.querySelector("[role=status]").hidden).toBe(false);
  });

  it("shows the given text while it is empty", () => {
    const empty = root.lastElementChild;
    list.empty = "Asking the robot…";
    expect(empty.hidden).toBe(true);
    list.items = [];
    expect([empty.textContent, empty.hidden, field.hidden]).toEqual([
      "Asking the robot…",
      false,
      true,
    ]);
    list.items = [{ name: "wave" }];
    expect([empty.hidden, field.hidden]).toEqual([true, false]);
  });

  it("acts on the only hit with Enter, and on none of several", () => {
    press("Enter");
    expect(act).not.toHaveBeenCalled();
    type("wav");
    press("Enter");
    expect(act).toHaveBeenCalledWith({ name: "wave" });
  });

  it("leaves Enter and Escape to an input method composing", () => {
    type("wav");
    for (const key of ["Enter", "Escape"])
      field.dispatchEvent(new KeyboardEvent("keydown", { key, isComposing: true }));
    expect(act).not.toHaveBeenCalled();
    expect(field.value).toBe("wav");
  });

  it("does not act on a disabled item", () => {
    type("uber");
    expect(shown()).toEqual(["über"]);
    press("Enter");
    root.querySelectorAll("button")[2].click();
    expect(act).not.toHaveBeenCalled();
  });

  it("is cleared by Escape, which then goes no further", () => {
    const outside = vi.fn();
    root.addEventListener("keydown", outside);
    type("wav");
    press("Escape");
    expect(field.value).toBe("");
    expect(shown().length).toBe(3);
    expect(outside).not.toHaveBeenCalled();
    press("Escape");
    expect(outside).toHaveBeenCalledTimes(1);
  });

  it("keeps the search when the items change", () => {
    type("bow");
    list.items = [{ name: "wave" }, { name: "bow" }, { name: "bowl" }];
    expect(shown()).toEqual(["bow", "bowl"]);
  });

  it("lists items by group, items without a group first", () => {
    const one = (name, kind) => ({ name, kind });
    list = new SearchList(root, {
      label: "Search",
      text: ({ name }) => name,
      group: ({ kind = "" }) => kind,
      act,
    });
    list.items = [one("wave", "demo"), one("bare"), one("home", "tuck"), one("bow", "demo")];
    expect(shown()).toEqual(["bare", "demo", "wave", "bow", "tuck", "home"]);
  });

  it("stays dim until told otherwise, also with new items", () => {
    const shown = () =>
      [...root.querySelectorAll("button")].map((one) => [
        one.getAttribute("aria-disabled"),
        one.title,
      ]);
    list.dim(true, "Take control first.");
    list.items = [{ name: "wave" }];
    expect(shown()).toEqual([["true", "Take control first."]]);
    list.dim(false, "");
    expect(shown()).toEqual([[null, ""]]);
  });
});
