import { afterEach, expect, test, vi } from "vitest";
import { readJson } from "../../../static/js/connection/read.js";

const FAILED = "It could not be read.";

function reading(answer) {
  vi.stubGlobal("fetch", vi.fn(answer));
  return readJson("/api/somewhere/", FAILED);
}

afterEach(() => vi.unstubAllGlobals());

test("the console's answer is read", async () => {
  expect(await reading(async () => ({ ok: true, json: async () => [1] }))).toEqual([1]);
});

test("a refusal is shown in the console's own words", async () => {
  const refusal = { code: "signed_out", text: "Not done: you are signed out. Sign in again." };
  const result = reading(async () => ({ ok: false, json: async () => refusal }));
  await expect(result).rejects.toThrow(refusal.text);
});

test("a browser's own error text is never shown", async () => {
  const away = () => Promise.reject(new TypeError("Failed to fetch"));
  await expect(reading(away)).rejects.toThrow(FAILED);
  const json = () => Promise.reject(new SyntaxError("Unexpected token '<'"));
  await expect(reading(async () => ({ ok: false, json }))).rejects.toThrow(FAILED);
  await expect(reading(async () => ({ ok: true, json }))).rejects.toThrow(FAILED);
  await expect(reading(async () => ({ ok: false, json: async () => ({}) }))).rejects.toThrow(
    FAILED,
  );
});
