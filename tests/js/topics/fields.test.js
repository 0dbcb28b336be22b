import { describe, expect, it } from "vitest";
import {
  figuresText,
  numberAt,
  PATHS_AT_MOST,
  rows,
  valueText,
  wholeLengths,
} from "../../../static/js/topics/fields.js";

const SCAN = {
  header: { seq: 7, stamp: { secs: 1, nsecs: 2 } },
  ranges: [1.5, 2.25],
  points: [{ x: 1 }, { x: 2 }],
  ok: true,
};

describe("a message as rows", () => {
  it("has a path for every field, lists of numbers in one row", () => {
    expect(rows(SCAN).map(({ path, leaf }) => (leaf ? path : `${path}/`))).toEqual([
      "header/",
      "header.seq",
      "header.stamp/",
      "header.stamp.secs",
      "header.stamp.nsecs",
      "ranges",
      "points/",
      "points[0]/",
      "points[0].x",
      "points[1]/",
      "points[1].x",
      "ok",
    ]);
  });

  it("ends before a page that nobody reads", () => {
    const many = Object.fromEntries(Array.from({ length: 1000 }, (_, i) => [`f${i}`, i]));
    expect(rows(many).length).toBe(PATHS_AT_MOST);
  });

  it("finds numbers by their paths", () => {
    expect(numberAt(SCAN, "header.stamp.nsecs")).toBe(2);
    expect(numberAt(SCAN, "points[1].x")).toBe(2);
    expect(numberAt(SCAN, "ok")).toBe(1);
    expect(numberAt(SCAN, "header")).toBe(null);
    expect(numberAt(SCAN, "gone.x")).toBe(null);
  });
});

describe("values and figures in words", () => {
  it("shortens numbers, and says how long a list is that is shown in part", () => {
    expect(valueText(0.123456)).toBe("0.123");
    expect(valueText(1e-9)).toBe("1.000e-9");
    expect(valueText([1, 2], 666)).toBe("[1, 2, … (666)]");
    expect(valueText("nan")).toBe("nan");
    expect(wholeLengths(["ranges (666)"]).get("ranges")).toBe(666);
  });

  it("tells rate, size, publishers and age", () => {
    const figures = { rate_hz: 9.96, bytes: 2700, age_s: 0.031, publishers: 1 };
    expect(figuresText(figures)).toBe("10.0 Hz · 2.7 kB · 1 publisher · stamped 0.03 s ago");
    expect(figuresText({ ...figures, publisher_names: ["/talker"] })).toContain(
      "1 publisher: /talker",
    );
    expect(figuresText({ ...figures, rate_hz: null, age_s: null })).toBe(
      "rate not known yet · 2.7 kB · 1 publisher",
    );
  });
});
