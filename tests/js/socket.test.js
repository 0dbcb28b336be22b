import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { LiveSocket, socketUrl } from "../../static/js/socket.js";

let made;

class FakeSocket extends EventTarget {
  static OPEN = 1;
  readyState = 0;
  bufferedAmount = 0;
  sent = [];

  constructor(url) {
    super();
    this.url = url;
    made.push(this);
  }

  opens() {
    this.readyState = 1;
    this.dispatchEvent(new Event("open"));
  }

  says(text) {
    this.dispatchEvent(Object.assign(new Event("message"), { data: text }));
  }

  send(text) {
    this.sent.push(JSON.parse(text));
  }

  close(code = 1006) {
    this.readyState = 3;
    this.dispatchEvent(Object.assign(new Event("close"), { code }));
  }
}

describe("the address", () => {
  it("is as safe as the page's own", () => {
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
    made = [];
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

  it("says whether a message could be sent", () => {
    expect(socket.send({ t: "stop" })).toBe(false);
    made[0].opens();
    expect(socket.send({ t: "stop" })).toBe(true);
    expect(made[0].sent).toEqual([{ t: "stop" }]);
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

  it("waits longer after each failure and starts afresh after a success", () => {
    for (let failures = 0; failures < 5; failures += 1) {
      made.at(-1).close();
      vi.advanceTimersByTime(2000);
    }
    expect(made).toHaveLength(6);
    made.at(-1).opens();
    made.at(-1).close();
    vi.advanceTimersByTime(250);
    expect(made).toHaveLength(7);
  });

  it("gives up a connection that is silent, and ignores what it still says", () => {
    made[0].opens();
    const heard = vi.fn();
    socket.addEventListener("down", heard);
    socket.reset();
    expect(heard).toHaveBeenCalledTimes(1);
    vi.advanceTimersByTime(250);
    expect(made).toHaveLength(2);
  });

  it("tries at once when the device is back in the network", () => {
    made[0].close();
    window.dispatchEvent(new Event("online"));
    expect(made).toHaveLength(2);
  });

  it("stays away once closed", () => {
    made[0].opens();
    socket.close();
    vi.advanceTimersByTime(10_000);
    window.dispatchEvent(new Event("online"));
    expect(made).toHaveLength(1);
  });
});
