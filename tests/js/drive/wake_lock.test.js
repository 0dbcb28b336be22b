import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { screenLock } from "../../../static/js/drive/wake_lock.js";

/** A fake of the browser's lock: its release event comes later. Hiding the page releases it. */
class Sentinel extends EventTarget {
  released = false;

  async release() {
    this.released = true;
    await Promise.resolve();
    this.dispatchEvent(new Event("release"));
  }
}

let locks;
let screen;
const settled = () => new Promise((resolve) => setTimeout(resolve));
const held = () => locks.filter((lock) => !lock.released).length;

async function show(visible) {
  Object.defineProperty(document, "hidden", { value: !visible, configurable: true });
  if (!visible) for (const lock of locks) await lock.release();
  document.dispatchEvent(new Event("visibilitychange"));
  await settled();
}

beforeEach(() => {
  locks = [];
  const request = vi.fn(async () => {
    await Promise.resolve();
    locks.push(new Sentinel());
    return locks.at(-1);
  });
  Object.defineProperty(navigator, "wakeLock", { value: { request }, configurable: true });
  screen = screenLock();
});

afterEach(async () => {
  screen.close();
  await show(true);
  delete navigator.wakeLock;
});

describe("the screen", () => {
  it("is kept on with one lock, also after repeated requests", async () => {
    screen.keep(true);
    screen.keep(true);
    await settled();
    screen.keep(true);
    await settled();
    expect(held()).toBe(1);
    screen.keep(false);
    await settled();
    expect(held()).toBe(0);
  });

  it("is kept on again when the page becomes visible", async () => {
    screen.keep(true);
    await settled();
    await show(false);
    expect(held()).toBe(0);
    await show(true);
    expect(held()).toBe(1);
  });

  it("is locked only after a hidden page becomes visible", async () => {
    await show(false);
    screen.keep(true);
    await settled();
    expect(locks).toEqual([]);
    await show(true);
    expect(held()).toBe(1);
  });

  it("is released if the request ends before the browser answers", async () => {
    screen.keep(true);
    screen.keep(false);
    await settled();
    expect(held()).toBe(0);
  });

  it("stays on when control is lost and taken again at once", async () => {
    screen.keep(true);
    await settled();
    screen.keep(false);
    screen.keep(true);
    await settled();
    expect(held()).toBe(1);
  });

  it("is left alone after close", async () => {
    screen.keep(true);
    await settled();
    screen.close();
    await show(false);
    await show(true);
    expect(held()).toBe(0);
  });

  it("may go dark if the browser forbids; driving continues", async () => {
    navigator.wakeLock.request.mockRejectedValue(new DOMException("", "NotAllowedError"));
    screen.keep(true);
    await settled();
    delete navigator.wakeLock;
    screen.keep(true);
    await settled();
    expect(held()).toBe(0);
  });
});
