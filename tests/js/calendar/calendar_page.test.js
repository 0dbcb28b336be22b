import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { atMost, startCalendar } from "../../../static/js/calendar/calendar_page.js";

const PAGE = `
  <main data-socket="/ws/bookings/" data-feed="/feed/" data-new="/new/" data-one="/" data-day="2026-03-02">
    <p data-part="hint">Drag.</p>
    <div data-part="toolbar"><h2 data-part="title"></h2></div>
    <div data-part="calendar"></div>
    <dialog data-part="dialog"><h2 data-part="dialog-title"></h2><p data-part="dialog-words"></p>
      <ul data-part="refusals"></ul><ul data-part="alternatives"></ul><button data-part="dialog-yes"></button></dialog>
  </main>`;

function open() {
  document.body.innerHTML = PAGE;
  let options = {};
  const calendar = { setOption: vi.fn(), getView: () => ({ title: "" }), refetchEvents: vi.fn() };
  const library = {
    create: (_element, given) => {
      options = given;
      return calendar;
    },
  };
  const end = startCalendar(document.querySelector("main"), library);
  const read = () =>
    options.eventSources[0].events({ startStr: "2026-03-02", endStr: "2026-03-03" });
  return { calendar, end, read, hint: document.querySelector("[data-part='hint']") };
}

const answer = (status, body) => ({ ok: status < 400, json: () => Promise.resolve(body) });

describe("the calendar", () => {
  beforeEach(() => {
    vi.stubGlobal("BroadcastChannel", EventTarget);
    vi.stubGlobal(
      "WebSocket",
      class extends EventTarget {
        close() {}
      },
    );
  });
  afterEach(() => vi.unstubAllGlobals());

  it("says why bookings cannot be read, until they can", async () => {
    const { end, read, hint } = open();
    const text = "Not done: the database does not answer.";
    vi.stubGlobal("fetch", () => Promise.resolve(answer(503, { text })));
    await expect(read()).rejects.toThrow(text);
    expect(hint.textContent).toBe(text);
    vi.stubGlobal("fetch", () => Promise.resolve(answer(200, { resources: [], events: [] })));
    await read();
    expect(hint.textContent).toBe("Drag.");
    end();
  });

  it("keeps its columns, and so a drag that runs, while the robots stay the same", async () => {
    const { calendar, end, read } = open();
    const resources = [{ id: "tiago-1", title: "TIAGo 1" }];
    vi.stubGlobal("fetch", () => Promise.resolve(answer(200, { resources, events: [] })));
    await read();
    await read();
    const columns = calendar.setOption.mock.calls.filter(([name]) => name === "resources");
    expect(columns).toEqual([["resources", resources]]);
    end();
  });
});

describe("reads of a busy calendar", () => {
  afterEach(() => vi.useRealTimers());

  it("follow at once, then once for all that came meanwhile", () => {
    vi.useFakeTimers();
    const step = vi.fn();
    const call = atMost(step, 500);
    for (let n = 0; n < 5; n += 1) call();
    expect(step).toHaveBeenCalledTimes(1);
    vi.advanceTimersByTime(600);
    expect(step).toHaveBeenCalledTimes(2);
    vi.advanceTimersByTime(600);
    expect(step).toHaveBeenCalledTimes(2);
  });
});
