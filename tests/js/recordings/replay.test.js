import { describe, expect, it, vi } from "vitest";
import { spanText } from "../../../static/js/formats/spans.js";
import { addressOf } from "../../../static/js/recordings/downloads.js";
import { nearest, Player } from "../../../static/js/recordings/player.js";
import { firstPicture, milliseconds } from "../../../static/js/recordings/recorded_pictures.js";
import { plotted } from "../../../static/js/recordings/recorded_plots.js";
import { RecordedViews } from "../../../static/js/recordings/recorded_views.js";
import { goesOn, saysOf, sizeText } from "../../../static/js/recordings/recording_words.js";
import { gaps } from "../../../static/js/recordings/timeline.js";

const PARTS = [
  [0, 10],
  [20, 30],
];

describe("the player", () => {
  it("skips what the person does not see", () => {
    expect([nearest(PARTS, 5), nearest(PARTS, 12), nearest(PARTS, 99)]).toEqual([5, 20, 30]);
    const player = new Player(PARTS, 9);
    player.playing = true;
    player.speed = 2;
    player.pass(1);
    expect(player.atS).toBe(20);
  });

  it("ends at the end, and begins again from there", () => {
    const player = new Player(PARTS, 29);
    player.playing = true;
    player.pass(5);
    expect([player.atS, player.playing]).toEqual([30, false]);
    player.playing = true;
    expect(player.atS).toBe(0);
  });
});

describe("recorded views", () => {
  const until = (views) => new Promise((done) => views.addEventListener("read", done));

  it("are read once, in pieces within the part, and shown until the next one", async () => {
    const read = vi.fn(async (from, to) => ({ views: [[from, { from }, null]], until_s: to }));
    const views = new RecordedViews(read);
    expect(views.at(6, [0, 7])).toBe(null);
    await until(views);
    expect(views.at(6.9, [0, 7])[1]).toEqual({ from: 5 });
    expect(read.mock.calls).toEqual([[5, 7]]);
  });

  it("are asked again from where an answer ended", async () => {
    const read = vi.fn(async (from) => ({ views: [[from, {}, null]], until_s: from + 2 }));
    const views = new RecordedViews(read);
    views.at(1, [0, 5]);
    await until(views);
    expect(read.mock.calls.map(([from]) => from)).toEqual([0, 2, 4]);
    expect(views.at(3, [0, 5])[0]).toBe(2);
  });

  it("say why they cannot be read, and are asked again after a while, not with each moment", async () => {
    vi.useFakeTimers();
    const read = vi.fn(async (from, to) => ({ views: [[from, {}, null]], until_s: to }));
    read.mockRejectedValueOnce(new Error("away"));
    const views = new RecordedViews(read);
    const told = [];
    views.addEventListener("problem", ({ detail }) => told.push(detail));
    views.addEventListener("read", () => views.at(1, [0, 5])); // as the page does
    for (let moment = 0; moment < 60; moment += 1) {
      views.at(1 + moment / 60, [0, 5]);
      await vi.advanceTimersByTimeAsync(16);
    }
    expect([read.mock.calls.length, told, views.has(1, [0, 5])]).toEqual([1, ["away"], false]);
    await vi.advanceTimersByTimeAsync(2000);
    expect([read.mock.calls.length, told, views.has(1, [0, 5])]).toEqual([2, ["away", ""], true]);
    vi.useRealTimers();
  });

  it("are read for each part, also where two parts share a piece", async () => {
    const read = vi.fn(async (from, to) => ({ views: [[from, { from }, null]], until_s: to }));
    const views = new RecordedViews(read);
    views.at(11, [0, 12]);
    await until(views);
    views.at(13.5, [13, 20]);
    expect(views.has(13.5, [13, 20])).toBe(false);
    await until(views);
    expect(views.at(13.5, [13, 20])[1]).toEqual({ from: 13 });
  });
});

it("asks for the picture of the last moment, and for none after it", () => {
  expect([milliseconds(12.345), milliseconds(12.3456), milliseconds(12)]).toEqual([
    "12.345",
    "12.345",
    "12.000",
  ]);
});

it("shows a compressed colour picture first", () => {
  const channel = (topic, type = "sensor_msgs/CompressedImage") => ({ topic, type });
  const found = [channel("/depth/c"), channel("/raw", "sensor_msgs/Image"), channel("/rgb/c")];
  expect([firstPicture(found), firstPicture([])]).toEqual(["/rgb/c", ""]);
});

it("plots a short part as a whole, a long one around the moment", () => {
  expect(plotted(50, [0, 60])).toEqual([0, 60]);
  expect(plotted(250, [100, 4000])).toEqual([240, 360]);
  expect(plotted(130, [125, 4000])).toEqual([125, 240]);
});

it("knows the times that nobody sees", () => {
  expect(gaps(PARTS, 40)).toEqual([
    [10, 20],
    [30, 40],
  ]);
  expect(gaps([[0, 40]], 40)).toEqual([]);
});

it("writes lengths and sizes", () => {
  expect([spanText(59.96, true), spanText(3723)]).toEqual(["1:00.0", "1:02:03"]);
  expect([sizeText(999), sizeText(1_250_000), sizeText(2e11)]).toEqual([
    "999 B",
    "1.3 MB",
    "200 GB",
  ]);
});

it("leaves empty fields out of a file's address", () => {
  expect(addressOf("/file", { format: "mcap", from: "", topics: "" })).toBe("/file");
  expect(addressOf("/file", { format: "bag", from: "1.5" })).toBe("/file?format=bag&from=1.5");
});

it("knows whether a recording goes on", () => {
  expect(goesOn(null)).toBe(false);
  expect(goesOn({ left_s: 0, refusal: { code: "disk_gone" } })).toBe(false);
  expect(goesOn({ left_s: 60, refusal: { code: "disk_slow" } })).toBe(true);
});

describe("what a recorded view says", () => {
  it("has a word where the file has no name", () => {
    const state = { verdict: { code: "stopped", text: "Stopped by …." }, text: "stopped" };
    expect(saysOf({ state })).toBe("Stopped by somebody.");
    const cut = { verdict: { code: "free", text: "" }, text: "the first wor…" };
    expect(saysOf({ state: cut })).toBe("the first wor…");
  });
});
