import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { startCalendar } from "../../../static/js/calendar/calendar_page.js";
import { atMost } from "../../../static/js/calendar/live.js";

const PAGE = `
  <main data-socket="/ws/bookings/" data-feed="/feed/" data-new="/new/" data-waiting="/wait/" data-one="/" data-day="2026-03-02">
    <p data-part="hint">Drag.</p>
    <div data-part="toolbar"><h2 data-part="title"></h2></div>
    <div data-part="calendar"></div>
    <dialog data-part="dialog"><h2 data-part="dialog-title"></h2><p data-part="dialog-words"></p>
      <ul data-part="refusals"></ul><ul data-part="alternatives"></ul>
      <form data-part="dialog-form"><div data-part="dialog-fields">
        <select name="course"><option value=""></option><option value="thesis"></option></select></div>
        <button type="button" data-part="dialog-wait" hidden></button><button data-part="dialog-yes"></button></form>
    </dialog><input name="csrfmiddlewaretoken" value="token">
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
  const select = (robot) =>
    options.select({
      startStr: "2026-03-02T10:00:00",
      endStr: "2026-03-02T11:00:00",
      resource: { id: robot, title: robot },
    });
  return { calendar, end, read, select, hint: document.querySelector("[data-part='hint']") };
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

describe("the dialog of a dragged slot", () => {
  const part = (name) => document.querySelector(`[data-part='${name}']`);
  const slot = { robot: "tiago-1", starts_at: "2026-03-02T10:00", ends_at: "2026-03-02T11:00" };
  let sent = [];
  let answers = [];

  beforeEach(() => {
    sent = [];
    vi.stubGlobal(
      "BroadcastChannel",
      class extends EventTarget {
        postMessage() {}
      },
    );
    vi.stubGlobal("WebSocket", EventTarget);
    HTMLDialogElement.prototype.show ??= function show() {
      this.open = true;
    };
    HTMLDialogElement.prototype.close ??= function close() {
      this.open = false;
    };
    vi.stubGlobal("fetch", (url, { body } = {}) => {
      if (url.startsWith("/feed/"))
        return Promise.resolve(
          answer(200, { resources: [{ id: "tiago-1", title: "TIAGo 1" }], events: [] }),
        );
      sent.push([url, Object.fromEntries(body)]);
      return Promise.resolve(answers.shift());
    });
  });
  afterEach(() => vi.unstubAllGlobals());

  it("sends the fields of the form, and another course after a refusal", async () => {
    const refusals = [{ code: "quota_course_week", text: "Too much." }];
    answers = [answer(409, { refusals }), answer(200, {})];
    const { calendar, read, select } = open();
    await read();
    select("tiago-1");
    part("dialog-yes").click();
    await vi.waitFor(() => expect(part("refusals").textContent).toBe("Too much."));
    expect(part("dialog-wait").hidden).toBe(true);
    document.querySelector("select").value = "thesis";
    part("dialog-yes").click();
    await vi.waitFor(() => expect(calendar.refetchEvents).toHaveBeenCalled());
    expect(sent).toEqual([
      ["/new/", { ...slot, course: "" }],
      ["/new/", { ...slot, course: "thesis" }],
    ]);
    expect(part("dialog").open).toBe(false);
  });

  it("offers the waiting list of a slot that is only taken", async () => {
    answers = [answer(409, { refusals: [{ code: "taken", text: "Taken." }] }), answer(200, {})];
    const { read, select } = open();
    await read();
    select("tiago-1");
    part("dialog-yes").click();
    await vi.waitFor(() => expect(part("dialog-wait").hidden).toBe(false));
    part("dialog-wait").click();
    await vi.waitFor(() => expect(part("dialog-title").textContent).toBe("You wait for this slot"));
    expect(sent[1]).toEqual(["/wait/", { ...slot, course: "" }]);
    expect(part("dialog-yes").hidden).toBe(true);
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
