import { afterEach, beforeEach, expect, test } from "vitest";

import { inPageLanguage, sentence } from "../../../static/js/formats/sentences.js";

const SPANISH = {
  "{sensor} is {age:age} old": "{sensor}: hace {age:age}",
  "slowed from {asked:fine} to {allowed:fine} m/s": "de {asked:fine} a {allowed:fine} m/s",
  laser: "láser",
  "Stop.": "Pare.",
};

beforeEach(() => {
  document.documentElement.lang = "es";
  globalThis.gettext = (text) => SPANISH[text] ?? text;
  globalThis.ngettext = (one, many, count) => (count === 1 ? one : many);
});

afterEach(() => {
  document.documentElement.lang = "en-gb";
  globalThis.gettext = (text) => text;
});

test("a sentence in a sentence, and figures, in the page's language", () => {
  const said = ["{sensor} is {age:age} old", { sensor: ["laser"], age: 0.61 }];
  expect(sentence(said)).toBe("láser: hace 0,6 s");
  const slowed = ["slowed from {asked:fine} to {allowed:fine} m/s", { asked: 0.8, allowed: 0.05 }];
  expect(sentence(slowed)).toBe("de 0,8 a 0,05 m/s");
  expect(sentence(["{count} robot, {x:.2f}", { count: 2, x: 1 }, "{count} robots, {x:.2f}"])).toBe(
    "2 robots, 1,00",
  );
});

test("a time that the clock shows twice has its offset", () => {
  document.documentElement.dataset.zone = "Europe/Madrid";
  const at = (time) => sentence(["{at:clock}; {at:when}", { at: time }]);
  expect(at("2027-10-31T00:30:00Z")).toMatch(/^02:30 \(UTC\+2\); .* 02:30 \(UTC\+2\)$/);
  expect(at("2027-10-31T01:30:00Z")).toMatch(/^02:30 \(UTC\+1\)/);
  expect(at("2027-10-31T02:00:00Z")).toMatch(/^03:00; [^(]*$/);
  expect(at("2027-03-28T01:00:00Z")).toMatch(/^03:00; [^(]*$/);
  delete document.documentElement.dataset.zone;
});

test("each sentence of a message, but no text in a language of its own", () => {
  const message = {
    t: "view",
    state: {
      text: "Stop.",
      verdict: {
        text: "laser is 0.6 s old",
        said: { text: ["{sensor} is {age:age} old", { sensor: ["laser"], age: 0.61 }] },
      },
      speech: { text: "Stop.", language: "en-GB" },
      problems: ["laser is 0.6 s old", "laser"],
      said: {
        problems: [["{sensor} is {age:age} old", { sensor: ["laser"], age: 0.61 }], ["laser"]],
      },
      battery_percent: null,
    },
    scan: { laser_cm: [1, 2] },
  };
  const { state, scan } = inPageLanguage(message);
  expect([state.text, state.verdict.text, state.speech.text]).toEqual([
    "Pare.",
    "láser: hace 0,6 s",
    "Stop.",
  ]);
  expect(state.problems).toEqual(["láser: hace 0,6 s", "láser"]);
  expect(scan).toBe(message.scan);
});

test("moments in the page's zone, and days", () => {
  document.documentElement.dataset.zone = "Europe/Madrid";
  const figures = { at: "2026-12-03T14:00:00+00:00", day: "2026-12-03" };
  expect(sentence(["{at:clock} {at:when} {day:day}", figures])).toBe(
    "15:00 jue, 03 dic 2026, 15:00 03 dic 2026",
  );
});

test("a page in English shows the texts as they come", () => {
  document.documentElement.lang = "en-gb";
  const message = { text: "x", said: { text: ["y"] } };
  expect(inPageLanguage(message)).toBe(message);
});
