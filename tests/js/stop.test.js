import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { StopButton } from "../../static/js/stop.js";

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
    ways = { send: vi.fn(() => true), answered: vi.fn(() => true), say: vi.fn(), fail: vi.fn() };
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

  it("acts when it is pressed, and once though a click follows", () => {
    press();
    submit();
    expect(ways.send).toHaveBeenCalledTimes(1);
  });

  it("acts on every press", () => {
    press();
    press();
    expect(ways.send).toHaveBeenCalledTimes(2);
  });

  it("is pressed by keyboards and assistive technology, which submit", () => {
    expect(submit()).toBe(false); // the browser does not leave the page
    expect(ways.send).toHaveBeenCalledTimes(1);
  });

  it("goes by the form's address at once when there is no live connection", () => {
    ways.send.mockReturnValue(false);
    press();
    expect(fetch).toHaveBeenCalledTimes(1);
    const [address, options] = fetch.mock.calls[0];
    expect(address).toContain("/robots/tiago-1/stop/");
    expect(options).toMatchObject({ method: "POST", keepalive: true });
  });

  it("goes by the form's address too when the robot's side says nothing", () => {
    ways.answered.mockReturnValue(false);
    press();
    expect(fetch).not.toHaveBeenCalled();
    vi.advanceTimersByTime(400);
    expect(fetch).toHaveBeenCalledTimes(1);
  });

  it("is content when the robot's side has answered", () => {
    press();
    vi.advanceTimersByTime(5000);
    expect(fetch).not.toHaveBeenCalled();
  });

  it("asks whether a stop was reported since this press", () => {
    press();
    const pressedMs = performance.now();
    vi.advanceTimersByTime(400);
    expect(ways.answered).toHaveBeenCalledWith(pressedMs);
  });

  it("tells that the stop arrived by the form's address, and until then that it is being sent", async () => {
    ways.send.mockReturnValue(false);
    press();
    expect(ways.say.mock.calls).toEqual([["Sending the stop"]]);
    await settle();
    expect(ways.say).toHaveBeenLastCalledWith("Stopped.");
    expect(ways.fail).not.toHaveBeenCalled();
  });

  it("tells within seconds that no answer came", async () => {
    const timeOut = (ms) => {
      const ending = new AbortController();
      setTimeout(() => ending.abort(new DOMException("", "TimeoutError")), ms);
      return ending.signal;
    };
    vi.spyOn(AbortSignal, "timeout").mockImplementation(timeOut); // the timers here are not the browser's
    const never = (_address, { signal }) =>
      new Promise((_resolve, reject) => {
        signal.addEventListener("abort", () => reject(signal.reason));
      });
    vi.stubGlobal("fetch", vi.fn(never));
    ways.send.mockReturnValue(false);
    press();
    await vi.advanceTimersByTimeAsync(5000);
    expect(ways.fail.mock.calls[0][0]).toContain("No answer");
    vi.restoreAllMocks();
  });

  it("takes no page for success", async () => {
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

  it("names what was not reached", async () => {
    ways.send.mockReturnValue(false);
    vi.stubGlobal("fetch", answer(false, { text: "Not reached: TIAGo 1." }));
    press();
    await settle();
    expect(ways.fail).toHaveBeenCalledWith("Not reached: TIAGo 1.");
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
});
