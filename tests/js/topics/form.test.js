import { beforeEach, describe, expect, it } from "vitest";
import { MessageForm } from "../../../static/js/topics/form.js";

const POINT = ["x", "y"].map((name) => ({ name, type: "float64" }));
const FIELDS = [
  {
    name: "header",
    type: "std_msgs/Header",
    fields: [
      { name: "stamp", type: "builtin_interfaces/Time" },
      { name: "frame_id", type: "string" },
    ],
  },
  { name: "count", type: "uint8" },
  { name: "mode", type: "uint8", constants: { SLOW: 0, FAST: 3 } },
  { name: "on", type: "bool" },
  { name: "gains", type: "float64", array: 3 },
  { name: "names", type: "string", array: -1 },
  { name: "flags", type: "bool", array: -1 },
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

  it("holds the default values of a message", () => {
    expect(form.values).toEqual({
      header: { stamp: "now", frame_id: "" },
      count: 0,
      mode: 0,
      on: false,
      gains: [0, 0, 0],
      names: [],
      flags: [],
      points: [],
    });
  });

  it("reads nested fields, constants and arrays", () => {
    field("header-frame_id").value = "map";
    field("mode").value = "3";
    field("on").checked = true;
    field("gains").value = "1, 0.5, -2";
    field("names").value = "left, right";
    field("flags").value = "true, 0";
    expect(form.values).toMatchObject({
      header: { frame_id: "map" },
      mode: 3,
      on: true,
      gains: [1, 0.5, -2],
      names: ["left", "right"],
      flags: [true, false],
    });
  });

  it("has a form for each message of a list, to add and remove", () => {
    const add = () => root.querySelector('[aria-label="Add one to points"]').click();
    for (let count = 0; count < 3; count += 1) add();
    field("points-0-x").value = "1";
    field("points-1-x").value = "2";
    field("points-2-x").value = "3";
    root.querySelector('[aria-label="Remove points[1]"]').click();
    expect(form.values.points).toEqual([
      { x: 1, y: 0 },
      { x: 3, y: 0 },
    ]);
    expect(form.fault("points[1].x", "too far")).toBe(true);
    expect(field("points-2-x-note").textContent).toBe("too far");
    add();
    expect(form.values.points).toHaveLength(3);
  });

  it("has as many as a fixed list needs, very many as JSON", () => {
    const fields = [{ name: "x", type: "float64" }];
    form = new MessageForm(root, [
      { name: "pair", type: "e/P", array: 2, fields },
      { name: "many", type: "e/P", array: 1000, fields },
    ]);
    expect(root.querySelector("button")).toBe(null);
    expect(form.values).toBe(null);
    expect(field("many-note").textContent).toBe("Write exactly 1000 values.");
    field("many").value = JSON.stringify(Array(1000).fill({ x: 1 }));
    expect(form.values.pair).toEqual([{ x: 0 }, { x: 0 }]);
  });

  it("offers constants, and takes any other value of the type", () => {
    const choice = root.querySelector('[aria-label="Constants of mode"]');
    const choose = (name) => {
      choice.value = name;
      choice.dispatchEvent(new Event("change"));
    };
    expect([...choice.options].map(({ text }) => text)).toEqual([
      "another value",
      "SLOW = 0",
      "FAST = 3",
    ]);
    expect(choice.value).toBe("SLOW");
    choose("FAST");
    expect(form.values.mode).toBe(3);
    field("mode").value = "7";
    field("mode").dispatchEvent(new Event("input"));
    expect(choice.value).toBe("");
    expect(form.values.mode).toBe(7);
  });

  it.each(["constructor", "toString", "__proto__", "NaN", "  two  spaces "])(
    "sends the text %s as it is written",
    (text) => {
      field("header-frame_id").value = text;
      expect(JSON.parse(JSON.stringify(form.values)).header.frame_id).toBe(text);
    },
  );

  it("keeps all digits of a whole number, alone and in a list", () => {
    form = new MessageForm(root, [
      { name: "one", type: "uint64" },
      { name: "some", type: "int64", array: -1 },
    ]);
    field("one").value = "18446744073709551615";
    field("some").value = "9007199254740993, -9223372036854775808";
    const json = '{"one":18446744073709551615,"some":[9007199254740993,-9223372036854775808]}';
    expect(JSON.stringify(form.values)).toBe(json);
    field("some").value = "[9007199254740993, -9223372036854775808]";
    expect(JSON.stringify(form.values)).toBe(json);
  });

  it("takes a message without fields within another", () => {
    form = new MessageForm(root, [{ name: "ping", type: "std_msgs/Empty" }]);
    expect(form.values).toEqual({ ping: {} });
  });

  it("has a checkbox for booleans, even with constants", () => {
    form = new MessageForm(root, [
      { name: "on", type: "bool", constants: { OFF: false, ON: true } },
    ]);
    field("on").checked = true;
    expect(form.values).toEqual({ on: true });
  });

  it("writes only into the message, whatever the field names", () => {
    const keys = Object.keys;
    const fields = [{ name: "keys", type: "string" }];
    form = new MessageForm(root, [{ name: "constructor", type: "e/C", fields }]);
    expect(JSON.stringify(form.values)).toBe('{"constructor":{"keys":""}}');
    expect(Object.keys).toBe(keys);
  });

  it.each([
    ["count", "1.5", "Write a whole number."],
    ["count", "many", "This is not a number."],
    ["count", "constructor", "This is not a number."],
    ["flags", "true, yes", "Write true or false."],
    ["gains", "1, 2", "Write exactly 3 values."],
    ["names", "[1", "Write a JSON list, such as [1, 2]."],
    ["header-stamp", "", "Write a number."],
  ])("says beside %s what is wrong with %s, and gives nothing", (path, text, words) => {
    field(path).value = text;
    expect(form.values).toBe(null);
    expect(field(path).getAttribute("aria-invalid")).toBe("true");
    expect(root.querySelector(`#field-${path}-note`).textContent).toBe(words);
  });

  it("shows an error that the bridge found, also within a list", () => {
    expect(form.fault("gains[1]", "gains[1]: a number.")).toBe(true);
    expect(field("gains-note").textContent).toBe("gains[1]: a number.");
    expect(form.fault("points[0].x", "points: at most 10000 values.")).toBe(true);
    expect(field("points-note").textContent).toBe("points: at most 10000 values.");
    expect(form.values).not.toBe(null);
    expect(field("points-note").hidden).toBe(true);
    expect(form.fault("elsewhere", "?")).toBe(false);
  });
});
