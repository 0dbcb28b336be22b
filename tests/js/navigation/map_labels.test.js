import { describe, expect, it } from "vitest";
import { placed } from "../../../static/js/navigation/map_labels.js";

const label = (left, top) => ({ text: "kitchen", left, top, half: 30 });
const mark = (left, top) => ({ left, top, radius: 14 });

describe("names on the map", () => {
  it("are below their points", () => {
    expect(placed([label(100, 50)], [], 400)).toMatchObject([{ left: 100, top: 63 }]);
  });

  it("cover no robot that stands below, nor one above as well", () => {
    expect(placed([label(100, 50)], [mark(110, 66)], 400)).toMatchObject([{ left: 100, top: 37 }]);
    const around = [mark(100, 68), mark(100, 32)];
    expect(placed([label(100, 50)], around, 400)).toMatchObject([{ left: 143, top: 50 }]);
  });

  it("cover no other name, and stay inside the picture", () => {
    const [first, second] = placed([label(5, 50), label(20, 52)], [], 400);
    expect(first).toMatchObject({ left: 30, top: 63 });
    expect(second).toMatchObject({ left: 30, top: 39 });
  });
});
