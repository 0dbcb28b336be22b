import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { LiveSocket, socketUrl } from "../../../static/js/connection/socket.js";
import { FakeSocket, made } from "../fake_socket.js";

describe("the address", () => {
  it("is encrypted if the page's own address is", () => {
    expect(socketUrl("/ws/fleet/", "https://lab.example/robots/a/")).toBe(
      "wss://lab.example/ws/fleet/",
    );
    expect(socketUrl("/ws/fleet/", "http://127.0.0.1:8000/")).toBe("ws://127.0.0.1:8000/ws/fleet/");
  });
});

describe("the live socket", () => {
  let socket;

  beforeEach(() => {
    vi.useFakeTimers();
    FakeSocket.begin();
    vi.stubGlobal("WebSocket", FakeSocket);
    socket = new LiveSocket("ws://here/");
    socket.connect();
  });

  afterEach(() => {
    socket.close();
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  it("hands over decoded messages", () => {
    const heard = [];
    socket.addEventListener("message", ({ detail }) => heard.push(detail));
    made[0].opens();
    made[0].says('{"t":"pong","sent_ms":3}');
    expect(heard).toEqual([{ t: "pong", sent_ms: 3 }]);
  });

  it.each(["connecting", "open", "closed"])(
    "takes over a socket that is %s, once",
    async (state) => {
      const early = new FakeSocket("ws://early/");
      window.earlySocket = early;
      if (state === "open") early.opens();
      if (state === "closed") early.close(4401);
      socket.reset(); // of another address
      vi.advanceTimersByTime(1000);
      expect(window.earlySocket).toBe(early);

      const before = made.length;
      const live = new LiveSocket("ws://early/");
      const opened = vi.fn();
      live.addEventListener("open", opened);
      live.connect();
      expect(opened).not.toHaveBeenCalled();
      if (state === "connecting") early.opens();
      await Promise.resolve();
      expect(live.open).toBe(state !== "closed");
      expect(opened).toHaveBeenCalledTimes(state === "closed" ? 0 : 1);
      expect(made).toHaveLength(state === "closed" ? before + 1 : before);
      expect(window.earlySocket).toBe(null);
      live.close();
    },
  );

  it("says whether a message could be sent", () => {
    expect(socket.send({ t: "stop" })).toBe(false);
    made[0].opens();
    expect(socket.send({ t: "stop" })).toBe(true);
    expect(made[0].sent).toEqual([{ t: "stop" }]);
  });

  it("counts only bytes that waited at the last question, too", () => {
    made[0].opens();
    expect(socket.takeBacklog()).toBe(0);
    socket.send({ t: "ack" });
    made[0].bufferedAmount = 11;
    expect(socket.takeBacklog()).toBe(0);
    socket.send({ t: "ack" });
    made[0].bufferedAmount = 22;
    expect(socket.takeBacklog()).toBe(11);
    made[0].bufferedAmount = 0;
    expect(socket.takeBacklog()).toBe(0);
  });

  it("comes back after a loss, quickly at first", () => {
    const codes = [];
    socket.addEventListener("down", ({ detail }) => codes.push(detail.code));
    made[0].opens();
    made[0].close(1006);
    expect(socket.open).toBe(false);
    vi.advanceTimersByTime(250);
    expect(made).toHaveLength(2);
    expect(codes).toEqual([1006]);
  });

  it("waits longer after each failure, until a connection lasts", () => {
    for (let failures = 0; failures < 5; failures += 1) {
      made.at(-1).close();
      vi.advanceTimersByTime(2000);
    }
    expect(made).toHaveLength(6);
    made.at(-1).opens();
    vi.advanceTimersByTime(11_000);
    made.at(-1).close();
    vi.advanceTimersByTime(250);
    expect(made).toHaveLength(7);
  });

  it("waits longer too when the server closes new connections", () => {
    for (let failures = 0; failures < 5; failures += 1) {
      made.at(-1).opens();
      made.at(-1).says('{"t":"welcome"}');
      made.at(-1).close(4503);
      vi.advanceTimersByTime(2000);
    }
    expect(made).toHaveLength(6);
    made.at(-1).opens();
    made.at(-1).close(4503);
    vi.advanceTimersByTime(1500);
    expect(made).toHaveLength(6);
    vi.advanceTimersByTime(500);
    expect(made).toHaveLength(7);
  });

  it("does not count a failed attempt as a lasting connection", () => {
    made[0].opens();
    vi.advanceTimersByTime(60_000);
    for (let failures = 0; failures < 5; failures += 1) {
      made.at(-1).close();
      vi.advanceTimersByTime(2000);
    }
    made.at(-1).close();
    vi.advanceTimersByTime(1500);
    expect(made).toHaveLength(6);
  });

  it("gives up a silent connection, ignores its late messages", () => {
    made[0].opens();
    const heard = vi.fn();
    socket.addEventListener("down", heard);
    socket.reset();
    expect(heard).toHaveBeenCalledTimes(1);
    vi.advanceTimersByTime(250);
    expect(made).toHaveLength(2);
  });

  it("tries at once when the device is online again", () => {
    made[0].close();
    window.dispatchEvent(new Event("online"));
    expect(made).toHaveLength(2);
  });

  it("gives up an attempt that does not open, then tries again", () => {
    vi.advanceTimersByTime(2900);
    expect(made).toHaveLength(1);
    vi.advanceTimersByTime(100 + 250);
    expect(made).toHaveLength(2);
    expect(made[0].readyState).toBe(3);
    made[1].opens();
    vi.advanceTimersByTime(60_000);
    expect(made).toHaveLength(2);
    expect(socket.open).toBe(true);
  });

  it("is patient after some attempts: it may be a slow network", () => {
    for (let failures = 0; failures < 4; failures += 1) {
      made.at(-1).close();
      vi.advanceTimersByTime(2000);
    }
    vi.advanceTimersByTime(7000);
    expect(made).toHaveLength(5);
    made[4].opens();
    expect(socket.open).toBe(true);
  });

  it("restarts a waiting attempt when the device is online", () => {
    window.dispatchEvent(new Event("online"));
    expect(made).toHaveLength(2);
    expect(made[0].readyState).toBe(3);
    made[1].opens();
    window.dispatchEvent(new Event("online")); // an open socket stays open
    expect(made).toHaveLength(2);
  });

  it.each([true, false])("stays away once closed (open before: %s)", (opens) => {
    if (opens) made[0].opens();
    socket.close();
    vi.advanceTimersByTime(10_000);
    window.dispatchEvent(new Event("online"));
    expect(made).toHaveLength(1);
  });
});
