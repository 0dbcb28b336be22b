import { beforeEach, describe, expect, it, vi } from "vitest";
import { HealthPanel } from "../../../static/js/health/health_panel.js";
import {
  batteryText,
  cardHealth,
  healthText,
  leftOutText,
  partText,
  temperaturesText,
} from "../../../static/js/health/health_words.js";

const WELL = {
  level: "ok",
  parts: [],
  parts_more: 0,
  well: 6,
  temperatures: [],
  left_out: 0,
  unread: 0,
};
const SPEAKERS = { name: "Speakers", level: "error", text: "no answer", since_s: 90 };
const MOTOR = { name: "Motor", level: "warning", text: "Too warm", since_s: 3 };
const NAMES = [
  "battery",
  "battery-percent",
  "health-open",
  "health-line",
  "health-parts",
  "temperatures",
  "health-more",
];

function ill(...parts) {
  return { ...WELL, level: parts[0].level, parts };
}

describe("health in words", () => {
  it("tells how long the battery lasts, not while it charges", () => {
    const state = { battery_percent: 83.6, battery_left_min: 210, charging: false };
    expect(batteryText(state)).toBe("84 %, about 3 h 30 min left");
    expect(batteryText({ ...state, charging: true })).toBe("84 %, charging");
    expect(batteryText({ ...state, battery_left_min: null })).toBe("84 %");
    expect(batteryText({ ...state, battery_percent: null })).toBe("–");
  });

  it("names the worst part, and counts the others", () => {
    expect(healthText(null)).toBe("–");
    expect(healthText(WELL)).toBe("All well (6 parts)");
    expect(healthText(ill(SPEAKERS))).toBe("Speakers: no answer");
    expect(healthText({ ...ill(SPEAKERS, MOTOR), parts_more: 4 })).toBe(
      "Speakers: no answer, and 5 more",
    );
    expect(cardHealth({ ...WELL, temperatures: [{ name: "Motor", celsius: 84 }] }, 0)).toBe(
      "All well (6 parts), at most 84 °C",
    );
    expect(cardHealth(ill(SPEAKERS), 1e12)).toMatch(/^Speakers: no answer \(since .+\)$/);
    expect(partText({ ...MOTOR, level: "silent" })).toBe("Motor: has stopped reporting");
    expect(partText({ ...MOTOR, text: "" })).toBe("Motor: warns, without a reason");
    expect(temperaturesText([{ name: "Motor", celsius: 84 }])).toBe("Motor 84 °C");
    expect(leftOutText(WELL)).toBe("");
    expect(leftOutText({ parts_more: 2, left_out: 200, unread: 3 })).toMatch(/2 more.*200.*3 rep/);
  });
});

describe("health on the control page", () => {
  let parts;
  let notify;
  let panel;

  beforeEach(() => {
    parts = Object.fromEntries(NAMES.map((name) => [name, document.createElement("ul")]));
    notify = vi.fn();
    panel = new HealthPanel(parts, notify);
  });

  function shown(health, ms = 0, more = {}) {
    panel.show({ battery_percent: 80, charging: false, health, ...more }, false, 1e12 + ms);
  }

  it("is in the header only when something is wrong", () => {
    shown(WELL);
    expect(parts["health-open"].hidden).toBe(true);
    shown(ill(MOTOR));
    expect(parts["health-open"].hidden).toBe(false);
    expect(parts["health-open"].dataset.level).toBe("warn");
    expect(parts["health-parts"].textContent).toMatch(/Motor: Too warm \(since .*\)/);
    shown(null);
    expect(parts["health-line"].textContent).toBe("No node of the robot reports.");
  });

  it("tells what gets worse: once, not at first, and a flapping part once a minute", () => {
    shown(ill(MOTOR));
    expect(notify).not.toHaveBeenCalled(); // the fault is older than this page
    const speakers = { ...SPEAKERS, since_s: 0 };
    shown(ill(speakers, MOTOR), 1000);
    shown(ill(speakers, MOTOR), 2000);
    expect(notify).toHaveBeenCalledExactlyOnceWith({
      level: "error",
      code: "health Speakers",
      text: "Speakers: no answer",
    });
    for (let ms = 3000; ms < 60_000; ms += 1000) shown(ms % 2000 ? WELL : ill(speakers), ms);
    expect(notify).toHaveBeenCalledTimes(1);
    shown(WELL, 62_000);
    shown(ill(speakers), 63_000);
    expect(notify).toHaveBeenCalledTimes(2);
    shown(ill(MOTOR), 64_000); // the motor had a warning before, and has been well since
    expect(notify).toHaveBeenCalledTimes(3);
    shown(ill({ ...MOTOR, level: "error" }), 65_000);
    expect(notify).toHaveBeenLastCalledWith(expect.objectContaining({ level: "error" })); // worse than the last notice
  });

  it("tells nothing of a part that comes back into a full list unchanged", () => {
    shown(ill(MOTOR));
    const pushed = { ...ill({ ...SPEAKERS, since_s: 0 }), parts_more: 1 };
    shown(pushed, 100_000);
    expect(notify).toHaveBeenCalledTimes(1); // only the notice about the speakers
    shown(ill({ ...MOTOR, since_s: 200 }), 197_000);
    expect(notify).toHaveBeenCalledTimes(1);
    shown(WELL, 198_000);
    shown(ill({ ...MOTOR, level: "silent", since_s: 10 }), 260_000); // the motor's last report was 10 s ago
    expect(notify).toHaveBeenCalledTimes(2);
  });

  it("tells of a part that was well while the list was full, and is ill again", () => {
    shown(ill(MOTOR));
    const full = { ...ill({ ...SPEAKERS, since_s: 500 }), parts_more: 1 };
    shown(full, 100_000); // the speakers' fault is older than this page
    expect(notify).not.toHaveBeenCalled();
    shown({ ...ill({ ...MOTOR, since_s: 1 }), parts_more: 1 }, 900_000);
    expect(notify).toHaveBeenCalledExactlyOnceWith(
      expect.objectContaining({ code: `health ${MOTOR.name}` }),
    );
  });

  it("tells once that the battery is low", () => {
    shown(WELL, 0, { battery_percent: 20.4 });
    for (const percent of [19.9, 20.1, 19.8]) shown(WELL, 1000, { battery_percent: percent });
    expect(notify).toHaveBeenCalledExactlyOnceWith(
      expect.objectContaining({ level: "warning", text: "The battery is low: 20 %." }),
    );
    expect(parts.battery.dataset.low).toBe("true");
  });
});
