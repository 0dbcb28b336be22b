import { beforeEach, describe, expect, it } from "vitest";
import { MessageForm } from "../../../static/js/topics/form.js";

const POINT = ["x", "y"].map((name) => ({ name, type: "float64" }));
const FIELDS = [
  {
    name: "header",
    type: "std_msgs/Header",
    fields: [
      { name: "stamp", type: "time" },
      { name: "frame_id", type: "string" },
    ],
  },
  { name: "count", type: "uint8" },
  { name: "mode", type: "uint8", constants: { SLOW: 0, FAST: 3 } },
  { name: "on", type: "bool" },
  { name: "gains", type: "float64", array: 3 },
  { name: "names", type: "string", array: -1 },
  { name: "points", type: "geometry_msgs/Point", array: -1, fields: POINT },
];

describe("a form made from a definition", () => {
  let root;
  let form;
  const field = (path) => root.querySelector(`#field-${path}`);

  beforeEach(() => {
    root = document.createElement("div");
    form = new MessageForm(root, FIELDS);
  });

  it("holds what an untouched message holds", () => {
    expect(form.values).toEqual({
      header: { stamp: "now", frame_id: "" },
      count: 0,
      mode: 0,
      on: false,
      gains: [0, 0, 0],
      names: [],
      points: [],
    });
  });

  it("reads nested fields, constants, arrays and lists of messages", () => {
    field("header-frame_id").value = "map";
    field("mode").value = "3";
    field("on").checked = true;
    field("gains").value = "1, 0.5, -2";
    field("names").value = "left, right";
    field("points").value = '[{"x": 1, "y": 2}]';
    expect(form.values).toMatchObject({
      header: { frame_id: "map" },
      mode: 3,
      on: true,
      gains: [1, 0.5, -2],
      names: ["left", "right"],
      points: [{ x: 1, y: 2 }],
    });
  });

  it("proposes constants by name, and takes any other value of the type too", () => {
    const names = [...root.querySelectorAll("#field-mode-constants option")].map((o) => o.value);
    expect(field("mode").getAttribute("list")).toBe("field-mode-constants");
    expect(names).toEqual(["SLOW", "FAST"]);
    field("mode").value = "FAST";
    expect(form.values.mode).toBe(3);
    field("mode").value = "7";
    expect(form.values.mode).toBe(7);
  });

  it("has a box for what is true or false, whatever constants its type has", () => {
    form = new MessageForm(root, [
      { name: "on", type: "bool", constants: { OFF: false, ON: true } },
    ]);
    field("on").checked = true;
    expect(form.values).toEqual({ on: true });
  });

  it("writes into nothing but the message, whatever its fields are called", () => {
    const keys = Object.keys;
    const fields = [{ name: "keys", type: "string" }];
    form = new MessageForm(root, [{ name: "constructor", type: "e/C", fields }]);
    expect(JSON.stringify(form.values)).toBe('{"constructor":{"keys":""}}');
    expect(Object.keys).toBe(keys);
  });

  it.each([
    ["count", "1.5", "Write a whole number."],
    [
      "count",
      "9007199254740993",
      "A browser would lose digits of this: publish it with a program.",
    ],
    ["count", "many", "This is not a number."],
    ["gains", "1, 2", "Write exactly 3 values."],
    ["points", "[1", "Write a JSON list, such as [1, 2]."],
    ["header-stamp", "", "Write a number."],
  ])("says beside %s what is wrong with %s, and gives nothing", (path, text, words) => {
    field(path).value = text;
    expect(form.values).toBe(null);
    expect(field(path).getAttribute("aria-invalid")).toBe("true");
    expect(root.querySelector(`#field-${path}-note`).textContent).toBe(words);
  });

  it("shows what the robot's side found wrong, also within a list", () => {
    expect(form.fault("points[0].x", "points[0].x is not a number.")).toBe(true);
    expect(root.querySelector("#field-points-note").textContent).toBe(
      "points[0].x is not a number.",
    );
    expect(form.fault("elsewhere", "?")).toBe(false);
  });
});
