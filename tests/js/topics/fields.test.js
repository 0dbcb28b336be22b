import { describe, expect, it } from "vitest";
import {
  figuresText,
  numberAt,
  PATHS_AT_MOST,
  rows,
  valueText,
} from "../../../static/js/topics/fields.js";

const SCAN = {
  header: { seq: 7, stamp: { secs: 1, nsecs: 2 } },
  ranges: [1.5, 2.25],
  points: [{ x: 1 }, { x: 2 }],
  ok: true,
};

describe("a message as rows", () => {
  it("has a path for every field, lists of numbers in one row", () => {
    const found = rows({ ...SCAN, words: "a", none: [], odd: "NaN" });
    expect(found.map(({ path, kind }) => `${path} ${kind}`)).toEqual([
      "header branch",
      "header.seq number",
      "header.stamp branch",
      "header.stamp.secs number",
      "header.stamp.nsecs number",
      "ranges numbers",
      "points branch",
      "points[0] branch",
      "points[0].x number",
      "points[1] branch",
      "points[1].x number",
      "ok number",
      "words text",
      "none text",
      "odd number",
    ]);
  });

  it("has a row for each element of an opened list", () => {
    const found = rows({ ranges: [1.5, "Infinity"] }, new Set(["ranges"]));
    expect(found.map(({ path, value, isOpen }) => [path, value, isOpen])).toEqual([
      ["ranges", [1.5, "Infinity"], true],
      ["ranges[0]", 1.5, false],
      ["ranges[1]", "Infinity", false],
    ]);
  });

  it("stops at a readable number of rows", () => {
    const many = Object.fromEntries(Array.from({ length: 1000 }, (_, i) => [`f${i}`, i]));
    expect(rows(many).length).toBe(PATHS_AT_MOST);
  });

  it("finds numbers by their paths", () => {
    expect(numberAt(SCAN, "header.stamp.nsecs")).toBe(2);
    expect(numberAt(SCAN, "points[1].x")).toBe(2);
    expect(numberAt(SCAN, "ok")).toBe(1);
    expect(numberAt({ a: "NaN" }, "a")).toBe(null);
    expect(numberAt(SCAN, "header")).toBe(null);
    expect(numberAt(SCAN, "gone.x")).toBe(null);
  });
});

describe("values and figures in words", () => {
  it("shorten numbers, and give a shortened list's length", () => {
    expect(valueText(0.123456)).toBe("0.123");
    expect(valueText(1e-9)).toBe("1.000e-9");
    expect(valueText([1, 2], 666)).toBe("[1, 2, … (666)]");
    expect(valueText("nan")).toBe("nan");
  });

  it("show rate, size, publishers and age", () => {
    const figures = { number: 9, rate_hz: 9.96, bytes: 2700, age_s: 0.031, publishers: 1 };
    expect(figuresText(figures)).toBe("10.0 Hz · 2.7 kB · 1 publisher · stamped 0.03 s ago");
    expect(figuresText({ ...figures, publisher_names: ["/talker"] })).toContain(
      "1 publisher: /talker",
    );
    expect(figuresText({ ...figures, rate_hz: null, age_s: null, since_s: 7.04 })).toBe(
      "one message so far · 2.7 kB · 1 publisher · 7.0 s ago",
    );
  });

  it.each([
    [{ rate_hz: 0.1 }, "0.10 Hz"],
    [{ rate_hz: 0.0 }, "0.00 Hz"],
    [{ rate_hz: 99.6 }, "100 Hz"],
    [{ age_s: -5 }, "stamped 5.0 s ahead"],
    [{ age_s: 119 }, "stamped 119 s ago"],
    [{ age_s: 600 }, "stamped 10 min ago"],
    [{ age_s: 10_800 }, "stamped 3 h ago"],
    [{ age_s: 1e9 }, "stamped 11574 days ago"],
    [{ age_s: null, since_s: 0.2 }, "just now"],
  ])("says %o in words", (changed, words) => {
    const figures = { number: 2, rate_hz: 1, bytes: 0, age_s: 0, since_s: 0, publishers: 1 };
    expect(figuresText({ ...figures, ...changed })).toContain(words);
  });

  it("show only the publishers before the first message", () => {
    expect(figuresText({ number: 0, rate_hz: null, bytes: 0, age_s: null, publishers: 1 })).toBe(
      "1 publisher",
    );
  });
});
