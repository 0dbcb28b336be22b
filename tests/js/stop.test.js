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
    vi.stubGlobal("fetch", answer(true, {}));
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
