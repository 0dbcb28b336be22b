import { describe, expect, it } from "vitest";
import { paintScale, scaleText } from "../../../static/js/camera/scale.js";

describe("the scale of a picture of depth or heat", () => {
  it("is in metres where that is known, else in the sensor's numbers", () => {
    expect(scaleText({ low: 0.4123, high: 3.214, unit: "m" })).toBe("0.4 to 3.2 m");
    expect(scaleText({ low: 1.2, high: 1.34, unit: "m" })).toBe("1.20 to 1.34 m");
    expect(scaleText({ low: 29310, high: 31020, unit: "" })).toBe("29310 to 31020");
  });

  it("says that no pixel has a value, and nothing of ordinary pictures", () => {
    expect(scaleText({ low: null, high: null, unit: "m" })).toBe("no pixel has a value");
    expect([scaleText(null), scaleText(undefined)]).toEqual(["", ""]);
  });

  it("is written into the picture", () => {
    const written = [];
    const pen = { fillRect() {}, fillText: (...given) => written.push(given) };
    paintScale(pen, "", 320, 240);
    expect(written).toEqual([]);
    paintScale(pen, "0.4 to 3.2 m", 320, 240);
    const [[text, x, y, width]] = written;
    expect([text, width]).toEqual(["0.4 to 3.2 m", 320]);
    expect(x > 0 && y > 200 && y <= 240).toBe(true);
  });
});
