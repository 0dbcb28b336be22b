import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import "../../../static/js/fleet/stop_all.js";

vi.hoisted(() => {
  document.body.innerHTML =
    '<form data-stop-all action="/stop-all/"><b data-part="stop-all-state"></b><button></button></form>';
});

describe("Stop all on a page without connection", () => {
  const state = document.querySelector("b");
  const answers = (ok, text) =>
    vi.stubGlobal(
      "fetch",
      vi.fn(async () => ({ ok, json: async () => ({ text }) })),
    );
  const press = () => document.querySelector("button").dispatchEvent(new Event("pointerdown"));

  beforeEach(() => {
    vi.useFakeTimers();
  });
  afterEach(() => {
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  it("shows a failure until pressed again, success for seconds", async () => {
    answers(false, "Not reached: TIAGo 2.");
    press();
    await vi.advanceTimersByTimeAsync(60_000);
    expect(state.textContent).toBe("Not reached: TIAGo 2.");
    answers(true, "Stopped.");
    press();
    await vi.advanceTimersByTimeAsync(1000);
    expect(state.textContent).toBe("Stopped.");
    await vi.advanceTimersByTimeAsync(5000);
    expect(state.textContent).toBe("");
  });
});
