import { afterEach, expect, test, vi } from "vitest";
import { readJson } from "../../../static/js/lib/read.js";

const FAILED = "It could not be read.";

function reading(answer) {
  vi.stubGlobal("fetch", vi.fn(answer));
  return readJson("/api/somewhere/", FAILED);
}

afterEach(() => vi.unstubAllGlobals());

test("what the console answers is read", async () => {
  expect(await reading(async () => ({ ok: true, json: async () => [1] }))).toEqual([1]);
});

test("why the console did not answer is told in its own words", async () => {
  const refusal = { code: "signed_out", text: "Not done: you are signed out. Sign in again." };
  const told = reading(async () => ({ ok: false, json: async () => refusal }));
  await expect(told).rejects.toThrow(refusal.text);
});

test("a browser's own words for a failure are never told", async () => {
  const away = () => Promise.reject(new TypeError("Failed to fetch"));
  await expect(reading(away)).rejects.toThrow(FAILED);
  const json = () => Promise.reject(new SyntaxError("Unexpected token '<'"));
  await expect(reading(async () => ({ ok: false, json }))).rejects.toThrow(FAILED);
  await expect(reading(async () => ({ ok: true, json }))).rejects.toThrow(FAILED);
  await expect(reading(async () => ({ ok: false, json: async () => ({}) }))).rejects.toThrow(
    FAILED,
  );
});
