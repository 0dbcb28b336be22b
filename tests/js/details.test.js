import { expect, test } from "vitest";
import { latencyText, watchersText } from "../../static/js/details.js";

test("a latency that was not measured yet is said to be assumed", () => {
  expect(latencyText({ latency_s: 0.2, latency_measured: false })).toBe("200 ms (assumed)");
  expect(latencyText({ latency_s: 0.113, latency_measured: true })).toBe("113 ms");
});

test("a crowd of onlookers is some names and a number", () => {
  expect(watchersText({ watchers: [], watchers_more: 0 })).toBe("Nobody");
  expect(watchersText({ watchers: ["Ann", "Bob"], watchers_more: 0 })).toBe("Ann, Bob");
  expect(watchersText({ watchers: ["Ann", "Bob"], watchers_more: 12 })).toBe("Ann, Bob, 12 more");
});
