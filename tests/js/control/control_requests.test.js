import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { ControlRequests, isControlRequest } from "../../../static/js/control/control_requests.js";

describe("control requests", () => {
  let sent;
  let notices;
  let requests;
  let open;
  const texts = () => notices.map(({ text }) => text);

  beforeEach(() => {
    vi.useFakeTimers();
    sent = [];
    notices = [];
    open = true;
    const send = (message) => open && sent.push(message) > 0;
    requests = new ControlRequests(send, (notice) => notices.push(notice));
  });
  afterEach(() => {
    requests.close();
    vi.useRealTimers();
  });

  it.each([
    ["take", { state: "yours" }, "You have control."],
    ["take_over", { state: "yours" }, "You have control."],
    ["renew", { state: "yours", remaining_s: 900 }, "You keep control: 15:00 left."],
    ["release", { state: "free" }, "You released control."],
    [
      "ask",
      { state: "other", holder: "Ann", asking: 3 },
      "You wait in line. Ann knows that you ask for control.",
    ],
    ["ask_cancel", { state: "other", holder: "Ann" }, "You have left the line."],
  ])("of kind %s cause one notice when they are done", (t, control, text) => {
    requests.send({ t });
    expect(sent).toEqual([{ t }]);
    expect(requests.receive(control)).toBe(true);
    expect(requests.receive(control)).toBe(false);
    vi.advanceTimersByTime(20_000);
    expect(notices).toEqual([{ level: "success", code: `${t} done`, text, quiet: true }]);
  });

  it("are not answered by an older state", () => {
    requests.send({ t: "take" });
    requests.send({ t: "ask" });
    expect(requests.receive({ state: "other", holder: "Ann" })).toBe(false);
    expect(notices).toEqual([]);
  });

  it("to keep control ignore other news of the same session", () => {
    requests.receive({ state: "yours", remaining_s: 200 });
    vi.advanceTimersByTime(10_000);
    requests.send({ t: "renew" });
    expect(requests.receive({ state: "yours", remaining_s: 190, requests: [{ number: 1 }] })).toBe(
      false,
    );
    expect(requests.receive({ state: "yours", remaining_s: 900 })).toBe(true);
    requests.send({ t: "renew" }); // immediately after the first
    expect(requests.receive({ state: "yours", remaining_s: 899.9 })).toBe(true);
    expect(texts()).toEqual(["You keep control: 15:00 left.", "You keep control: 15:00 left."]);
  });

  it("accept a late answer when control is kept soon after taking", () => {
    requests.receive({ state: "yours", remaining_s: 900 });
    vi.advanceTimersByTime(1000);
    requests.send({ t: "renew" });
    vi.advanceTimersByTime(400);
    expect(requests.receive({ state: "yours", remaining_s: 899.7 })).toBe(true);
  });

  it("repeat the console's own words", () => {
    requests.send({ t: "hand_over", number: 3 });
    expect(requests.receive({ state: "other", holder: "Ann" })).toBe(true);
    expect(notices).toEqual([]);
  });

  it("end when the robot reports the result", () => {
    requests.done("clear"); // another person cleared it
    requests.send({ t: "clear", number: 2 });
    requests.done("clear");
    requests.done("clear");
    expect(texts()).toEqual(["The stop is cleared."]);
  });

  it("name the request and the reason when refused", () => {
    requests.send({ t: "renew" });
    requests.refused("renew", { code: "somebody_asks", text: "Bo asks for control." });
    vi.advanceTimersByTime(20_000);
    expect(notices).toEqual([
      { level: "warning", code: "renew somebody_asks", text: "More time: Bo asks for control." },
    ]);
  });

  it("report a missing answer after 0.75 s, then a late one", () => {
    requests.send({ t: "take" });
    vi.advanceTimersByTime(749);
    expect(notices).toEqual([]);
    vi.advanceTimersByTime(1);
    expect(texts()).toEqual(["Take control: no answer within 0.75 s. It may still come."]);
    expect(requests.receive({ state: "yours", remaining_s: 900 })).toBe(true);
    expect(texts()).toHaveLength(2);
    requests.send({ t: "renew" });
    vi.advanceTimersByTime(60_000);
    expect(requests.receive({ state: "yours", remaining_s: 900 })).toBe(false);
    expect(texts()).toHaveLength(3);
  });

  it("report a missing answer once, also after a lost connection", () => {
    requests.send({ t: "take" });
    vi.advanceTimersByTime(4000);
    requests.lost();
    expect(texts()).toHaveLength(1);
  });

  it("report a missing and a lost connection", () => {
    requests.send({ t: "release" });
    requests.lost();
    requests.lost();
    open = false;
    requests.send({ t: "take_over", reason: "a test" });
    expect(texts()).toEqual([
      "Release: The connection was lost before an answer came.",
      "Take over: There is no connection to the server.",
    ]);
  });

  it("are known by their kind", () => {
    expect(isControlRequest("clear")).toBe(true);
    expect(isControlRequest("drive")).toBe(false);
  });
});
