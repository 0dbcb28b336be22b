import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { ControlPalette } from "../../../static/js/palette/control_palette.js";

const OFFERS = {
  motions: [
    { name: "wave", title: "Wave", description: "for help" },
    { name: "home", title: "Home" },
  ],
  languages: ["en"],
  uses: { speech: {} },
};
const ANSWERS = {
  "/phrases": { phrases: [{ text: "Hello", language: "en", tags: ["greeting"] }] },
  "/api/v1/maps?robot=t1": {
    maps: [{ robots: ["t1"], places: [{ name: "Kitchen", x: 1.00049, y: 2, heading: 0 }] }],
  },
  "/api/v1/robots": {
    robots: [
      { slug: "t1", name: "One", profile: "tiago", enabled: true },
      { slug: "t2", name: "Two", profile: "tiago", enabled: true },
    ],
  },
};

describe("the palette", () => {
  let palette;
  let request;
  const menu = () => document.querySelector("details");
  const dialog = () => document.querySelector("dialog");
  const field = () => dialog().querySelector("input");
  const rows = () => [...dialog().querySelectorAll("[role=option]")];
  const names = () => rows().map((row) => row.children[0].textContent);
  const chosen = () => dialog().querySelector("[aria-selected=true] span")?.textContent;
  const key = (name, more = {}) =>
    field().dispatchEvent(new KeyboardEvent("keydown", { key: name, bubbles: true, ...more }));
  const search = (text) => {
    field().value = text;
    field().dispatchEvent(new Event("input"));
  };
  const open = async () => {
    const event = { code: "KeyK", ctrlKey: true, cancelable: true };
    window.dispatchEvent(new KeyboardEvent("keydown", event));
    await vi.waitFor(() => expect(rows().length).toBeGreaterThan(5));
  };

  beforeEach(() => {
    document.body.innerHTML = `<details open><summary></summary><nav class="menu-list">
      <button><kbd>Ctrl K</kbd></button><a href="#help">Help</a></nav></details><main></main>`;
    const root = document.querySelector("main");
    Object.assign(root.dataset, { robot: "t1", phrases: "/phrases" });
    vi.stubGlobal("fetch", async (address) => ({ ok: true, json: async () => ANSWERS[address] }));
    request = vi.fn();
    palette = new ControlPalette({
      root,
      parts: { "palette-open": document.querySelector("button") },
      request,
    });
    palette.facts = { has_map: true };
    palette.offers = OFFERS;
    palette.mayAct = true;
  });

  afterEach(() => {
    palette.close();
    vi.unstubAllGlobals();
  });

  it("finds motions, phrases, places, other robots and pages", async () => {
    await open();
    expect(names()).toEqual(["Wave", "Home", "Hello", "Kitchen", "Two", "Help"]);
    search("greet");
    expect(names()).toEqual(["Hello"]);
    search("help"); // a name comes before what a motion is for
    expect(names()).toEqual(["Help", "Wave"]);
    search("zzz");
    expect(dialog().textContent).toContain("No match.");
  });

  it.each([
    ["wave", { t: "play", motion: "wave", title: "Wave" }],
    ["hello", { t: "say", text: "Hello", language: "en" }],
    ["kitchen", { t: "go", x: 1, y: 2, heading: 0, place: "Kitchen" }],
  ])("sends the request of the button: %s", async (text, sent) => {
    await open();
    search(text);
    key("Enter");
    expect(request.mock.calls).toEqual([[sent]]);
    expect(dialog().open).toBe(false);
  });

  it("does nothing by Enter until a person has searched or chosen", async () => {
    await open();
    key("Enter");
    expect(request).not.toHaveBeenCalled();
    key("ArrowDown");
    key("ArrowDown");
    expect(chosen()).toBe("Home");
    key("Enter", { repeat: true }); // the key of the search before, still held
    expect(request).not.toHaveBeenCalled();
    key("Enter");
    expect(request.mock.calls[0][0].motion).toBe("home");
  });

  it("says why an entry cannot act, and does not act", async () => {
    await open();
    search("wave");
    palette.mayAct = false; // control ended meanwhile
    expect(rows()[0].getAttribute("aria-disabled")).toBe("true");
    expect(rows()[0].textContent).toContain("Take control first.");
    key("Enter");
    rows()[0].click();
    expect(request).not.toHaveBeenCalled();
    expect(dialog().open).toBe(true);
  });

  it("opens from the menu, which it shuts, and closes by Esc and when the focus leaves", async () => {
    document.querySelector("button").click();
    expect(menu().open).toBe(false);
    expect(document.activeElement).toBe(field());
    search("wave");
    key("Escape");
    expect([field().value, dialog().open]).toEqual(["", true]);
    key("Escape");
    expect(dialog().open).toBe(false);
    await open();
    field().blur();
    await vi.waitFor(() => expect(dialog().open).toBe(false));
  });
});
