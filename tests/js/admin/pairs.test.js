import { beforeEach, expect, test } from "vitest";

import { jsonOf, pairsOf, showRows } from "../../../static/js/admin/pairs.js";

beforeEach(() => {
  globalThis.gettext = (text) => text;
  document.body.replaceChildren();
});

test("objects become rows and come back unchanged", () => {
  const aliases = '{"tiago-42c": "10.68.0.1"}';
  expect(pairsOf(aliases, "text")).toEqual([["tiago-42c", "10.68.0.1"]]);
  const overrides = { topics: { map: null }, limits: { forward_mps: 0.5 }, gate: {} };
  const pairs = pairsOf(JSON.stringify(overrides), "grouped");
  expect(pairs).toEqual([
    ["topics.map", "null"],
    ["limits.forward_mps", "0.5"],
  ]);
  expect(JSON.parse(jsonOf(pairs, "grouped"))).toEqual({
    topics: { map: null },
    limits: { forward_mps: 0.5 },
  });
});

test.each([
  ['{"__proto__": "10.68.0.1"}', "text"],
  ['{"__proto__": {"lost": 1}, "constructor": {"lost": 2}, "limits": {"__proto__": 3}}', "grouped"],
])("names that objects inherit are names like others: %s", (json, kind) => {
  const pairs = pairsOf(json, kind);
  expect(pairs).not.toEqual([]);
  expect(pairsOf(jsonOf(pairs, kind), kind)).toEqual(pairs);
  expect({}.lost ?? Object.lost).toBeUndefined();
});

test("a group takes the place of a value of its name, which the console would refuse", () => {
  const rows = [
    ["limits", "5"],
    ["limits.x", "1"],
  ];
  expect(JSON.parse(jsonOf(rows, "grouped"))).toEqual({ limits: { x: 1 } });
});

test("what is no object stays a box to repair by hand", () => {
  for (const wrong of ["[1]", "{", '{"a": 1}']) expect(pairsOf(wrong, "text")).toBeNull();
});

test("typing in a row changes the box that is sent", () => {
  const label = document.createElement("label");
  const box = document.createElement("textarea");
  box.dataset.pairs = "text";
  box.value = "{}";
  label.append("Host aliases:", box);
  document.body.append(label);
  showRows(box);
  expect(box.hidden).toBe(true);
  label.querySelector(".pairs > button").click();
  const [name, value] = label.querySelectorAll("input");
  name.value = "tiago";
  value.value = "10.0.0.1";
  value.dispatchEvent(new Event("input"));
  expect(JSON.parse(box.value)).toEqual({ tiago: "10.0.0.1" });
  expect(name.getAttribute("aria-label")).toContain("Name");
});
