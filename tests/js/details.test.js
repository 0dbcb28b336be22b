import { expect, test } from "vitest";
import { latencyText } from "../../static/js/details.js";

test("a latency that was not measured yet is said to be assumed", () => {
  expect(latencyText({ latency_s: 0.2, latency_measured: false })).toBe("200 ms (assumed)");
  expect(latencyText({ latency_s: 0.113, latency_measured: true })).toBe("113 ms");
});
