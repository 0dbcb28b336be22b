import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { DriveSender, isDue } from "../../../static/js/drive/drive_sender.js";
import { NEUTRAL, Stick } from "../../../static/js/drive/input/stick.js";

const FORWARD = { x: 1, y: 0, w: 0 };

describe("a drive message", () => {
  it("is due 30 times a second driving, 5 times at rest", () => {
    expect(isDue({ neutral: false, sinceLastMs: 20 })).toBe(false);
    expect(isDue({ neutral: false, sinceLastMs: 34 })).toBe(true);
    expect(isDue({ neutral: true, sinceLastMs: 100 })).toBe(false);
    expect(isDue({ neutral: true, sinceLastMs: 200 })).toBe(true);
  });
});

describe("the sender", () => {
  let sent;
  let backlog;
  let socket;
  let stick;
  let sender;

  beforeEach(() => {
    vi.useFakeTimers({ toFake: ["setInterval", "clearInterval", "performance"] });
    sent = [];
    backlog = 0;
    socket = { takeBacklog: () => backlog, send: (message) => sent.push(message) > 0 };
    stick = new Stick();
    sender = new DriveSender(socket, stick, () => performance.now());
    sender.share = 0.6;
  });

  afterEach(() => {
    sender.stop();
    vi.useRealTimers();
  });

  it("sends nothing without a fence", () => {
    stick.feed("keyboard", FORWARD);
    sender.start(7);
    sender.stop();
    const before = sent.length;
    vi.advanceTimersByTime(1000);
    stick.feed("keyboard", NEUTRAL);
    expect(sent.length).toBe(before);
  });

  it("sends about thirty a second while driving and five at rest", () => {
    sender.start(7);
    stick.feed("keyboard", FORWARD);
    vi.advanceTimersByTime(1000);
    expect(sent.length).toBeGreaterThanOrEqual(28);
    expect(sent.length).toBeLessThanOrEqual(32);
    stick.feed("keyboard", NEUTRAL);
    sent.length = 0;
    vi.advanceTimersByTime(1000);
    expect(sent.length).toBeGreaterThanOrEqual(4);
    expect(sent.length).toBeLessThanOrEqual(6);
  });

  it("sends rising numbers, fence, share and sending time", () => {
    sender.start(7);
    stick.feed("keyboard", FORWARD);
    vi.advanceTimersByTime(200);
    expect(sent[0]).toMatchObject({ t: "drive", fence: 7, share: 0.6, x: 1, y: 0, w: 0 });
    const numbers = sent.map(({ seq }) => seq);
    expect(numbers).toEqual([...new Set(numbers)].sort((a, b) => a - b));
    expect(sent[1].sent_ms).toBeGreaterThan(sent[0].sent_ms);
  });

  it("sends the ending zero at once, even into a full buffer", () => {
    sender.start(7);
    stick.feed("keyboard", FORWARD);
    backlog = 4000;
    stick.feed("keyboard", NEUTRAL);
    expect(sent.at(-1)).toMatchObject({ x: 0, y: 0, w: 0 });
  });

  it("sends only the newest position after a full buffer", () => {
    sender.start(7);
    stick.feed("keyboard", FORWARD);
    backlog = 4000;
    const before = sent.length;
    vi.advanceTimersByTime(300);
    expect(sent.length).toBe(before);
    stick.feed("keyboard", { x: 0.5, y: 0, w: 0 });
    backlog = 0;
    vi.advanceTimersByTime(40);
    expect(sent.at(-1).x).toBe(0.5);
  });

  it("keeps numbers rising over a reload of the page", () => {
    sender.start(7);
    vi.advanceTimersByTime(40);
    sender.stop();
    const { seq } = sent.at(-1);
    vi.advanceTimersByTime(5000);
    const reloaded = new DriveSender(socket, stick, () => performance.now());
    reloaded.start(8);
    vi.advanceTimersByTime(40);
    reloaded.stop();
    expect(sent.at(-1)).toMatchObject({ fence: 8 });
    expect(sent.at(-1).seq).toBeGreaterThanOrEqual(seq + 5000);
  });
});
