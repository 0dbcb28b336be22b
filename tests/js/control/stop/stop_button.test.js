import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { StopButton } from "../../../../static/js/control/stop/stop_button.js";

describe("the stop button", () => {
  let form;
  let ways;
  let stop;

  const answer = (ok, body) => vi.fn(async () => ({ ok, json: async () => body }));
  const settle = () => vi.advanceTimersByTimeAsync(0);

  beforeEach(() => {
    vi.useFakeTimers();
    form = document.body.appendChild(document.createElement("form"));
    form.action = "/robots/tiago-1/stop/";
    form.append(document.createElement("button"));
    ways = {
      send: vi.fn(() => true),
      answered: vi.fn(() => true),
      showText: vi.fn(),
      fail: vi.fn(),
    };
    stop = new StopButton(form, ways);
    vi.stubGlobal("fetch", answer(true, { text: "Stopped." }));
    vi.advanceTimersByTime(5000);
  });

  afterEach(() => {
    stop.close();
    document.body.replaceChildren();
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  const press = () =>
    form.firstChild.dispatchEvent(new Event("pointerdown", { bubbles: true, cancelable: true }));
  const submit = () => form.dispatchEvent(new Event("submit", { cancelable: true }));

  it("acts on pointer down, and once if a click follows", () => {
    press();
    submit();
    expect(ways.send).toHaveBeenCalledTimes(1);
  });

  it("acts on every press", () => {
    press();
    press();
    expect(ways.send).toHaveBeenCalledTimes(2);
  });

  it("acts on submit by keyboard or assistive technology", () => {
    expect(submit()).toBe(false); // the browser does not leave the page
    expect(ways.send).toHaveBeenCalledTimes(1);
  });

  it("posts the form at once without a live connection", () => {
    ways.send.mockReturnValue(false);
    press();
    expect(fetch).toHaveBeenCalledTimes(1);
    const [address, options] = fetch.mock.calls[0];
    expect(address).toContain("/robots/tiago-1/stop/");
    expect(options).toMatchObject({ method: "POST", keepalive: true });
  });

  it("posts the form too when the robot does not answer", () => {
    ways.answered.mockReturnValue(false);
    press();
    expect(fetch).not.toHaveBeenCalled();
    vi.advanceTimersByTime(400);
    expect(fetch).toHaveBeenCalledTimes(1);
  });

  it("does not post the form when the robot has answered", () => {
    ways.arrived = vi.fn();
    stop.close();
    stop = new StopButton(form, ways);
    press();
    vi.advanceTimersByTime(5000);
    expect(fetch).not.toHaveBeenCalled();
    expect(ways.arrived).toHaveBeenCalledTimes(1);
  });

  it("reports a pending stop once when both ways report it", async () => {
    const pending = { ok: true, status: 202, json: async () => ({ text: "Pending." }) };
    ways.answered.mockReturnValue(false);
    let answered;
    vi.stubGlobal("fetch", () => new Promise((resolve) => (answered = resolve)));
    press();
    vi.advanceTimersByTime(400);
    stop.refused("The stop is pending.");
    answered(pending);
    await settle();
    expect(ways.fail.mock.calls.map(([text]) => text)).toEqual(["Pending."]);
    stop.refused("The stop is pending."); // the refusal of a press that only the socket sent
    expect(ways.fail).toHaveBeenCalledTimes(2);
  });

  it("asks whether a stop was reported since this press", () => {
    press();
    const pressedMs = performance.now();
    vi.advanceTimersByTime(400);
    expect(ways.answered).toHaveBeenCalledWith(pressedMs);
  });

  it("shows Sending until the posted form is answered", async () => {
    ways.send.mockReturnValue(false);
    press();
    expect(ways.showText.mock.calls).toEqual([["Sending the stop"]]);
    await settle();
    expect(ways.showText).toHaveBeenLastCalledWith("Stopped.");
    expect(ways.fail).not.toHaveBeenCalled();
  });

  /** An answer, or an error, that comes after this number of seconds. */
  const later = (seconds, come, what) => () =>
    new Promise((resolve, reject) => {
      setTimeout(come === "answer" ? resolve : reject, 1000 * seconds, what);
    });
  const stopped = { ok: true, json: async () => ({ text: "Stopped." }) };

  it("reports a missing answer after 4 s, then a late answer", async () => {
    fetch.mockImplementation(later(6, "answer", stopped));
    ways.send.mockReturnValue(false);
    press();
    await vi.advanceTimersByTimeAsync(3900);
    expect(ways.fail).not.toHaveBeenCalled();
    await vi.advanceTimersByTimeAsync(200);
    expect(ways.fail.mock.calls).toEqual([[expect.stringContaining("No answer")]]);
    await vi.advanceTimersByTimeAsync(2000);
    expect(ways.showText).toHaveBeenLastCalledWith("Stopped.");
    await vi.advanceTimersByTimeAsync(10_000);
    expect(ways.fail).toHaveBeenCalledTimes(1);
  });

  it("never aborts a stop in progress", async () => {
    ways.send.mockReturnValue(false);
    press();
    expect(fetch.mock.calls[0][1]).not.toHaveProperty("signal");
  });

  it("reports failure of the newest press, success of any press", async () => {
    ways.send.mockReturnValue(false);
    fetch.mockImplementationOnce(later(20, "failure", new TypeError("gone")));
    press();
    await vi.advanceTimersByTimeAsync(1000);
    press();
    await vi.advanceTimersByTimeAsync(60_000);
    expect(ways.fail).not.toHaveBeenCalled();

    fetch.mockImplementationOnce(later(6, "answer", stopped));
    fetch.mockImplementationOnce(later(60, "answer", stopped));
    press();
    await vi.advanceTimersByTimeAsync(5000);
    press();
    ways.showText.mockClear();
    await vi.advanceTimersByTimeAsync(1500);
    expect(ways.showText).toHaveBeenCalledWith("Stopped.");
  });

  it("does not take an HTML page for success", async () => {
    ways.send.mockReturnValue(false);
    const page = async () => JSON.parse("<!doctype html>");
    vi.stubGlobal(
      "fetch",
      vi.fn(async () => ({ ok: true, json: page })),
    );
    press();
    await settle();
    expect(ways.fail.mock.calls[0][0]).toContain("red button");
  });

  it("names the robots not reached, by name and slug", async () => {
    const robots = { "tiago-1": { code: "bridge_down" } };
    ways.send.mockReturnValue(false);
    vi.stubGlobal("fetch", answer(false, { text: "Not reached: TIAGo 1.", robots }));
    press();
    await settle();
    expect(ways.fail).toHaveBeenCalledWith("Not reached: TIAGo 1.", robots);
  });

  it("does not confirm a pending stop", async () => {
    const robots = { "tiago-1": { code: "pending", pending: true } };
    ways.send.mockReturnValue(false);
    const body = { text: "Pending, not confirmed yet: TIAGo 1.", robots };
    const pending = { ok: true, status: 202, json: async () => body };
    vi.stubGlobal(
      "fetch",
      vi.fn(async () => pending),
    );
    press();
    await settle();
    expect(ways.showText).toHaveBeenCalledTimes(1); // only "Sending the stop"
    expect(ways.fail).toHaveBeenCalledWith(body.text, robots);
  });

  it("points to the red button when nothing gets through", async () => {
    ways.send.mockReturnValue(false);
    vi.stubGlobal("fetch", vi.fn().mockRejectedValue(new TypeError("offline")));
    press();
    await settle();
    expect(ways.fail.mock.calls[0][0]).toContain("red button");
  });

  it("does nothing more once the page has gone", () => {
    ways.answered.mockReturnValue(false);
    press();
    stop.close();
    press();
    vi.advanceTimersByTime(5000);
    expect(ways.send).toHaveBeenCalledTimes(1);
    expect(fetch).not.toHaveBeenCalled();
  });

  it("reports no failure once the page has gone", async () => {
    fetch.mockImplementation(later(6, "failure", new TypeError("gone")));
    ways.send.mockReturnValue(false);
    press();
    stop.close();
    await vi.advanceTimersByTimeAsync(10_000);
    expect(ways.fail).not.toHaveBeenCalled();
  });
});
