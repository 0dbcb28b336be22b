import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Heartbeat } from "../../../static/js/connection/heartbeat.js";

describe("the heartbeat", () => {
  let socket;
  let heartbeat;

  beforeEach(() => {
    vi.useFakeTimers();
    socket = { open: true, send: vi.fn(), reset: vi.fn() };
    heartbeat = new Heartbeat(socket);
    heartbeat.begin();
  });

  afterEach(() => {
    heartbeat.close();
    vi.useRealTimers();
  });

  it("gives up a connection silent for 4 s after a ping", () => {
    vi.advanceTimersByTime(5000);
    expect(socket.send).toHaveBeenCalled();
    expect(socket.reset).not.toHaveBeenCalled();
    vi.advanceTimersByTime(1000);
    expect(socket.reset).toHaveBeenCalledTimes(1);
  });

  it("takes any message as a sign of life", () => {
    for (let seconds = 0; seconds < 20; seconds += 1) {
      vi.advanceTimersByTime(1000);
      heartbeat.receive({ t: "fleet" });
    }
    expect(socket.reset).not.toHaveBeenCalled();
    expect(heartbeat.delayMs).toBeNull();
  });

  it("does not count the silence of the connection before", () => {
    vi.advanceTimersByTime(4900);
    heartbeat.begin();
    vi.advanceTimersByTime(4000);
    expect(socket.reset).not.toHaveBeenCalled();
  });

  it("waits without a connection, and after the page has gone", () => {
    socket.open = false;
    vi.advanceTimersByTime(20_000);
    socket.open = true;
    heartbeat.close();
    vi.advanceTimersByTime(20_000);
    expect(socket.send).not.toHaveBeenCalled();
    expect(socket.reset).not.toHaveBeenCalled();
  });

  it("measures the round trip by pongs", () => {
    vi.advanceTimersByTime(1000);
    const [{ sent_ms }] = socket.send.mock.calls[0];
    vi.advanceTimersByTime(80);
    heartbeat.receive({ t: "pong", sent_ms });
    expect(heartbeat.delayMs).toBe(80);
  });
});
