import { afterEach, beforeEach, describe, expect, it } from "vitest";
import { ClearAll } from "../../../static/js/fleet/clear_all.js";

const stop = (state, number, by = "Bo") => ({
  state,
  number,
  by,
  reason: "test",
  standstill_ms: 80,
});
const robot = (latch, mayClear = true) => ({ state: { stop: latch }, may_clear: mayClear });

describe("clear all", () => {
  let all;
  let sent;
  const names = ["clear-all", "clear-yes", "clear-list", "clear-none", "clear-dialog"];
  const part = (name) => document.querySelector(`[data-part=${name}]`);
  const rows = () => [...part("clear-list").children].map(({ textContent }) => textContent);

  beforeEach(() => {
    document.body.innerHTML = `
      <button data-part="clear-all" hidden></button>
      <dialog data-part="clear-dialog"><ul data-part="clear-list"></ul><p data-part="clear-none"></p>
        <button data-close></button><button data-part="clear-yes"></button></dialog>`;
    sent = [];
    const parts = Object.fromEntries(names.map((name) => [name, part(name)]));
    all = new ClearAll(
      parts,
      (message) => sent.push(message) > 0,
      (slug) => slug.toUpperCase(),
    );
  });
  afterEach(() => all.close());

  it("is shown only while a robot is stopped", () => {
    all.robots = { a: robot(stop("clear", 1)), b: { state: null } };
    expect(part("clear-all").hidden).toBe(true);
    all.robots = { a: robot(stop("stopped", 2)), b: { state: null } };
    expect(part("clear-all").hidden).toBe(false);
    expect(part("clear-all").textContent).toBe("Clear all (1)…");
  });

  it("lists each stop and clears it by the number shown", () => {
    all.robots = { a: robot(stop("stopped", 2)), b: robot(stop("stopping", 7, null)) };
    part("clear-all").click();
    expect(rows()[0]).toContain("AStopped by Bo. test Standstill confirmed after 80 ms.");
    expect(rows()[1]).toContain("The person who stopped it is not known.");
    part("clear-yes").click();
    expect(sent).toEqual([
      { t: "clear", slug: "a", number: 2 },
      { t: "clear", slug: "b", number: 7 },
    ]);
    all.robots = { a: robot(stop("clear", 2)), b: robot(stop("stopped", 7)) };
    all.refused({ text: "Not done.", figures: { slug: "b" } });
    expect(rows()[0]).toContain("Cleared.");
    expect(rows()[1]).toContain("Not done.");
  });

  it("does not clear a robot that was stopped again since", () => {
    all.robots = { a: robot(stop("stopped", 2)) };
    part("clear-all").click();
    all.robots = { a: robot(stop("stopped", 3, "Ann")) };
    expect(rows()[0]).toContain("Ann stopped it again");
    part("clear-yes").click();
    expect(sent).toEqual([]);
  });

  it("names the roles that may, to everybody else", () => {
    all.robots = { a: robot(stop("stopped", 2), false), b: robot(stop("stopped", 4)) };
    part("clear-all").click();
    expect(rows()[0]).toContain("a supervisor of this robot, or staff may clear it");
    part("clear-yes").click();
    expect(sent.map(({ slug }) => slug)).toEqual(["b"]);
    all.robots = { a: robot(stop("stopped", 2), false) };
    part("clear-all").click();
    expect(part("clear-yes").hidden).toBe(true);
    expect(part("clear-none").hidden).toBe(false);
  });
});
