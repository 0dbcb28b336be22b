import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { WallPage } from "../../../static/js/fleet/wall_page.js";
import { FakeSocket, made } from "../fake_socket.js";

const NAMES = [
  "status",
  "doing",
  "alarm",
  "why",
  "turn",
  "recorded",
  "battery",
  "health",
  "driver",
  "booking",
  "gate",
  "stop-state",
  "stop-why",
];
const state = {
  phase: "online",
  stop: { state: "clear" },
  verdict: { code: "idle", text: "" },
  battery_percent: 80,
  odometry: { vx: 0.4, vy: 0, w: 0 },
  holder: "Ann",
};

describe("the lab's monitor", () => {
  let root;
  let page;
  const part = (name) => document.querySelector(`[data-part="${name}"]`);
  const tell = (message) => made[0].says(JSON.stringify(message));

  beforeEach(() => {
    vi.useFakeTimers();
    vi.stubGlobal("WebSocket", FakeSocket);
    FakeSocket.begin();
    document.body.innerHTML = `<main data-socket="/ws/fleet/" data-stays>
      <span data-part="connection"></span><time data-part="clock"></time>
      <li data-robot="one">${NAMES.map((name) => `<p data-part="${name}"></p>`).join("")}</li></main>`;
    root = document.querySelector("main");
    page = new WallPage(root);
    made[0].opens();
  });
  afterEach(() => {
    page.close();
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  it("shows what each robot does, and greys when nothing comes", () => {
    tell({ t: "fleet", robots: { one: { state, refusal: null }, unknown: { state } } });
    for (let beats = 0; beats < 4; beats += 1) {
      vi.advanceTimersByTime(200);
      tell({ t: "beat" }); // nothing changed
    }
    expect(part("doing").textContent).toBe("Drives at 0.4 m/s");
    expect(part("driver").textContent).toBe("Ann");
    expect(part("connection").textContent).toBe("Connected");
    expect(root.querySelector("li").dataset.stale).toBeUndefined();
    vi.advanceTimersByTime(600);
    expect(root.querySelector("li").dataset.stale).toBe("true");
  });
});
