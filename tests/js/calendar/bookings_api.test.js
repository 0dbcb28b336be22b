import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { send } from "../../../static/js/calendar/bookings_api.js";

const answer = (status, body) => ({
  ok: status < 400,
  json: () => (body ? Promise.resolve(body) : Promise.reject(new SyntaxError())),
});

describe("a change of a booking", () => {
  beforeEach(() => {
    document.body.innerHTML = '<input name="csrfmiddlewaretoken" value="token">';
  });
  afterEach(() => vi.unstubAllGlobals());

  it("shows every refusal", async () => {
    const refusals = [{ text: "Taken." }, { text: "Too long." }];
    vi.stubGlobal("fetch", () => Promise.resolve(answer(409, { refusals })));
    expect((await send("/", {})).texts).toEqual(["Taken.", "Too long."]);
  });

  it("shows why the database did not store it", async () => {
    const text = "Not done: another process keeps the database locked.";
    vi.stubGlobal("fetch", () => Promise.resolve(answer(503, { code: "database_locked", text })));
    expect(await send("/", {})).toEqual({ ok: false, texts: [text], codes: [], alternatives: [] });
  });

  it.each([
    ["no connection", () => Promise.reject(new TypeError())],
    ["no JSON", () => Promise.resolve(answer(502, null))],
  ])("says that nothing was changed without an answer: %s", async (_what, fetch) => {
    vi.stubGlobal("fetch", fetch);
    expect((await send("/", {})).texts[0]).toContain("Nothing was changed");
  });
});
