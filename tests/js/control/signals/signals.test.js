import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Signals } from "../../../../static/js/control/signals/signals.js";

const READY = {
  stop: { state: "clear" },
  verdict: { code: "idle", asked: [0, 0, 0], allowed: [0, 0, 0] },
};
const STOPPED = { ...READY, stop: { state: "stopped" } };
const HELD = { ...READY, verdict: { code: "obstacle", asked: [0.4, 0, 0], allowed: [0, 0, 0] } };
const SILENT = { who: "robot", forMs: 500 };

describe("signals", () => {
  const tell = vi.fn();
  let kept;
  let button;
  let signals;
  const begin = (isOn) => {
    button = document.createElement("button");
    button.hidden = true;
    const choices = {
      recall: (name, fallback) => kept[name] ?? fallback,
      remember: (name, value) => {
        kept[name] = value;
      },
    };
    const ways = [
      { name: "sound", isOn, isThere: () => true, tell },
      { name: "vibration", isOn: true, isThere: () => false, tell },
    ];
    signals = new Signals({ "signal-sound": button }, choices, ways);
    signals.follow(READY, null, "", 0);
  };

  beforeEach(() => {
    tell.mockClear();
    kept = {};
  });
  afterEach(() => signals.close());

  it("tell a stop, a hold and a lost link once, with the reason", () => {
    begin(true);
    signals.follow(STOPPED, null, "Stopped by Bo", 2000);
    signals.follow(STOPPED, null, "Stopped by Bo Berg", 2100);
    signals.follow(READY, null, "", 6000);
    signals.follow(HELD, null, "Something is ahead", 6100);
    signals.follow(HELD, SILENT, "The robot does not answer", 9200);
    expect(tell.mock.calls).toEqual([
      ["stop", "Stopped by Bo"],
      ["held", "Something is ahead"],
      ["lost", "The robot does not answer"],
    ]);
  });

  it("come at most every three seconds: later, if the moment still lasts", () => {
    begin(true);
    signals.follow(HELD, null, "", 2000);
    signals.follow(READY, null, "", 2100);
    signals.follow(HELD, null, "", 2200); // over before it may be told
    signals.follow(STOPPED, null, "", 2300);
    expect(tell.mock.calls.map(([moment]) => moment)).toEqual(["held"]);
    signals.follow(STOPPED, null, "", 5000);
    expect(tell.mock.calls.map(([moment]) => moment)).toEqual(["held", "stop"]);
  });

  it("say nothing in the first second, nor later of what was there then", () => {
    begin(true);
    signals.follow(STOPPED, null, "", 900);
    signals.follow(STOPPED, null, "", 5000);
    expect(tell).not.toHaveBeenCalled();
  });

  it("follow the person's choice, which is kept, and give an example", () => {
    begin(false);
    expect([button.hidden, button.getAttribute("aria-pressed")]).toEqual([false, "false"]);
    signals.follow(STOPPED, null, "", 2000);
    expect(tell).not.toHaveBeenCalled();
    button.click();
    expect(kept).toEqual({ sound: true });
    expect(button.getAttribute("aria-pressed")).toBe("true");
    expect(tell).toHaveBeenCalledTimes(1);
    button.click();
    expect(kept).toEqual({ sound: false });
    expect(tell).toHaveBeenCalledTimes(1);
  });
});
