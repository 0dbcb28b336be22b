import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Choices } from "../../../../static/js/control/choices.js";
import { Arrange } from "../../../../static/js/control/layout/arrange.js";
import { contentsOf, placed, resized } from "../../../../static/js/control/layout/cells.js";
import { parts } from "../../../../static/js/lib/dom.js";

const SURVEY = {
  cells: ["map", "plot /odom x"],
  side: false,
  stick: true,
  panels: ["motions", "chart", "phrases"],
};
const FACTS = { cameras: [{ name: "head" }], has_map: true };

describe("the cells", () => {
  it("offer what the robot has", () => {
    expect(contentsOf({})).toEqual(["plan", "scene"]);
    expect(contentsOf(FACTS)).toEqual(["camera", "plan", "map", "scene"]);
    expect(contentsOf({ cameras: [{}, {}] })).toEqual(["camera", "plan", "scene", "second"]);
  });

  it("keep their contents when their number changes", () => {
    expect(resized(["map"], 3, contentsOf(FACTS))).toEqual(["map", "camera", "plan"]);
    expect(resized(["map", "camera", "plan"], 1, contentsOf(FACTS))).toEqual(["map"]);
    expect(resized([], 4, contentsOf({}))).toEqual(["plan", "scene", "plot", "plot"]);
  });

  it("exchange contents", () => {
    expect(placed(["camera", "plan", "map"], 0, "map")).toEqual(["map", "plan", "camera"]);
    expect(placed(["camera", "plan"], 1, "scene")).toEqual(["camera", "scene"]);
    expect(placed(["camera", "plot /odom x"], 1, "camera")).toEqual(["plot /odom x", "camera"]);
    expect(placed(["camera", "plot"], 0, "plot")).toEqual(["plot", "plot"]);
  });
});

describe("a layout", () => {
  let root;
  let found;
  let arrange;
  let told;
  let desk;
  const cells = () => told.filter((news) => "cells" in news).at(-1).cells;
  const beside = () => {
    const { panel } = root.querySelector("[data-place=left]").dataset;
    return [root.dataset.lists, root.dataset.joystick, panel];
  };
  const count = (n) => root.querySelector(`[data-count="${n}"]`).click();
  const open = (person) => {
    told = [];
    const tell = (news) => told.push(news);
    const choices = new Choices({ person });
    arrange = new Arrange({ root, parts: found, choices, notify: () => {}, tell });
    arrange.facts = FACTS;
  };

  beforeEach(() => {
    vi.stubGlobal("fetch", () => Promise.reject(new Error("offline"))); // the browser's copy is enough
    desk = Object.assign(new EventTarget(), { matches: true });
    vi.stubGlobal("matchMedia", () => desk);
    document.body.innerHTML = `<main data-robot="tiago-1" data-layouts="/layouts" data-stick="true">
      <button data-part="arrange-open" aria-expanded="false"></button>
      <section data-part="arrange" hidden><button data-part="arrange-close"></button>
        <div data-part="arrange-count">${[0, 1, 2, 3, 4]
          .map((n) => `<button data-count="${n}"></button>`)
          .join("")}</div>
        <div data-part="arrange-cells"></div>
        <div data-part="layouts" hidden><ul data-part="layouts-list"></ul>
          <form data-part="layout-form" hidden><input data-part="layout-name"></form>
          <p data-part="layouts-fault" hidden></p></div>
        <input type="checkbox" data-part="arrange-side"><input type="checkbox" data-part="arrange-stick">
        <button data-part="arrange-reset"></button></section>
      <section data-panel="chart"></section>
      <section data-panel="motions"><button data-moves="motions"></button>
      </section></main>`;
    root = document.querySelector("main");
    found = parts(root);
  });
  afterEach(() => arrange.close());

  it("is none at first: the page looks as always", () => {
    open("ada");
    expect(beside()).toEqual([undefined, undefined, "chart"]);
    expect([cells(), found["arrange-side"].checked]).toEqual([null, true]);
  });

  it("is kept for this robot, and ends by a reset", () => {
    open("ben");
    count(3);
    const [first] = found["arrange-cells"].children;
    first.value = "scene";
    first.dispatchEvent(new Event("change", { bubbles: true }));
    arrange.plotted = { at: 2, content: "plot /odom x" };
    found["arrange-side"].click();
    found["arrange-stick"].click();
    const left = new KeyboardEvent("keydown", { key: "ArrowLeft", bubbles: true });
    root.querySelector("[data-moves]").dispatchEvent(left);
    arrange.close();
    open("ben");
    expect(cells()).toEqual(["scene", "plan", "plot /odom x"]);
    expect(beside()).toEqual(["hidden", "hidden", "motions"]);
    found["arrange-reset"].click();
    expect(cells()).toBe(null);
    expect(beside()).toEqual([undefined, undefined, "chart"]);
    arrange.close();
    root.dataset.robot = "tiago-2";
    open("ben");
    expect(cells()).toBe(null);
  });

  it("has no effect in a small window, and on tabs without the stick", () => {
    open("cy");
    count(2);
    expect(cells()).toEqual(["camera", "plan"]);
    desk.matches = false;
    desk.dispatchEvent(new Event("change"));
    expect(cells()).toBe(null);
    desk.matches = true;
    delete root.dataset.stick;
    arrange.tab = "speech";
    expect(cells()).toBe(null);
  });

  it("opens and closes by keys", () => {
    open("di");
    found["arrange-open"].click();
    expect([found.arrange.hidden, document.activeElement]).toEqual([false, found["arrange-close"]]);
    const esc = new KeyboardEvent("keydown", { key: "Escape", bubbles: true });
    found["arrange-close"].dispatchEvent(esc);
    expect([found.arrange.hidden, document.activeElement]).toEqual([true, found["arrange-open"]]);
  });

  describe("that is shared", () => {
    let asked;
    const texts = () =>
      [...found["layouts-list"].querySelectorAll("button")].map((b) => b.textContent);
    const answering = (status, body) =>
      vi.stubGlobal("fetch", async (address, { method = "GET", body: sent } = {}) => {
        if (address === "/layouts" || address.startsWith("/layouts/"))
          asked.push([method, address, sent && JSON.parse(sent)]);
        return { ok: status < 300, status, json: async () => body };
      });

    beforeEach(() => {
      asked = [];
      answering(200, { layouts: [{ number: 4, name: "Survey", ...SURVEY }] });
    });

    it("can be chosen by everybody", async () => {
      open("eve");
      arrange.role = "operator";
      found["arrange-open"].click();
      await vi.waitFor(() => expect(texts()).toEqual(["Survey"]));
      expect([found.layouts.hidden, found["layout-form"].hidden]).toEqual([false, true]);
      found["layouts-list"].querySelector("button").click();
      expect([cells(), ...beside()]).toEqual([SURVEY.cells, "hidden", undefined, "motions"]);
    });

    it("is shared and deleted by supervisors, who read why one is refused", async () => {
      open("flo");
      arrange.role = "supervisor";
      count(2);
      answering(201, { number: 5, name: "Pair", cells: ["camera", "plan"], side: true });
      found["layout-name"].value = " Pair ";
      found["layout-form"].dispatchEvent(new Event("submit", { cancelable: true }));
      await vi.waitFor(() => expect(texts()).toEqual(["Pair", "×"]));
      const panels = ["chart", "motions", "phrases"];
      const pair = { name: "Pair", cells: ["camera", "plan"], side: true, stick: true, panels };
      expect(asked).toEqual([["POST", "/layouts", pair]]);
      answering(409, { detail: "This name is taken." });
      found["layout-name"].value = "Pair";
      found["layout-form"].dispatchEvent(new Event("submit", { cancelable: true }));
      await vi.waitFor(() =>
        expect(found["layouts-fault"].textContent).toBe("This name is taken."),
      );
      answering(204, null);
      found["layouts-list"].querySelector("[aria-label]").click();
      await vi.waitFor(() => expect(texts()).toEqual([]));
      expect(asked.at(-1)).toEqual(["DELETE", "/layouts/5", null]);
    });
  });
});
