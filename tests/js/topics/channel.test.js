import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { TopicsChannel } from "../../../static/js/topics/channel.js";
import { FakeSocket, made } from "../fake_socket.js";

/** A fake that reports the end of a socket late, like a browser: on a dead network after many seconds. */
class SlowSocket extends FakeSocket {
  close() {
    this.readyState = 2;
  }

  ends() {
    super.close();
  }
}

describe("the channel of the topics", () => {
  let channel;

  beforeEach(() => {
    vi.useFakeTimers();
    FakeSocket.begin();
    vi.stubGlobal("WebSocket", SlowSocket);
    channel = new TopicsChannel("ws://here/");
    channel.open();
    made[0].opens();
  });

  afterEach(() => {
    channel.close();
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  it("reports a late answer, but not one that came in time", async () => {
    const late = vi.fn();
    channel.addEventListener("late", late);
    const asked = channel.ask({ t: "topics" });
    made[0].says('{"t": "graph", "seq": 1, "topics": []}');
    await asked;
    vi.advanceTimersByTime(2000);
    expect(late).not.toHaveBeenCalled();
    const second = channel.ask({ t: "topics" });
    vi.advanceTimersByTime(750);
    expect(late).toHaveBeenCalledTimes(1);
    made[0].says('{"t": "graph", "seq": 2, "topics": []}');
    expect(await second).toMatchObject({ seq: 2 });
  });

  it("reports late answers once, and again after they came", async () => {
    const late = vi.fn();
    channel.addEventListener("late", late);
    const asked = [channel.ask({ t: "topics" }), channel.ask({ t: "parameters" })];
    vi.advanceTimersByTime(2000);
    expect(late).toHaveBeenCalledTimes(1);
    made[0].says('{"t": "graph", "seq": 1, "topics": []}');
    made[0].says('{"t": "parameters", "seq": 2, "names": []}');
    await Promise.all(asked);
    channel.ask({ t: "topics" }).catch(() => {});
    vi.advanceTimersByTime(750);
    expect(late).toHaveBeenCalledTimes(2);
  });

  it("ignores a socket that it has closed", async () => {
    channel.close();
    channel.open();
    made[1].opens();
    const shown = vi.fn();
    channel.subscribe("/odom", 5, shown);
    const asked = channel.ask({ t: "topics" });
    made[0].says('{"t": "sample", "topic": "/odom", "number": 1}');
    made[0].ends();
    made[1].says('{"t": "graph", "seq": 1, "topics": []}');
    expect(await asked).toMatchObject({ t: "graph" });
    expect(shown).not.toHaveBeenCalled();
  });

  it("gives up a silent socket and renews its subscriptions", async () => {
    channel.subscribe("/odom", 5, () => {});
    const asked = expect(channel.ask({ t: "topics" })).rejects.toThrow("connection was lost");
    vi.advanceTimersByTime(6000);
    await asked;
    vi.advanceTimersByTime(250);
    made[1].opens();
    expect(made[1].sent).toEqual([{ t: "subscribe", topic: "/odom", rate_hz: 5 }]);
  });

  it("pauses subscriptions while its page is hidden", () => {
    channel.subscribe("/odom", 5, () => {});
    const hidden = vi.spyOn(document, "hidden", "get").mockReturnValue(true);
    document.dispatchEvent(new Event("visibilitychange"));
    expect(made[0].sent.at(-1)).toEqual({ t: "unsubscribe", topic: "/odom" });
    made[0].ends();
    vi.advanceTimersByTime(250);
    made[1].opens();
    expect(made[1].sent).toEqual([]); // a connection that returns on a hidden page has no subscriptions
    hidden.mockReturnValue(false);
    document.dispatchEvent(new Event("visibilitychange"));
    expect(made[1].sent).toEqual([{ t: "subscribe", topic: "/odom", rate_hz: 5 }]);
  });

  it("renews the same subscriptions when opened again", () => {
    channel.subscribe("/odom", 5, () => {});
    channel.close();
    channel.open();
    made[1].opens();
    expect(made[1].sent).toEqual([{ t: "subscribe", topic: "/odom", rate_hz: 5 }]);
  });

  it("fails a query when the connection is lost", async () => {
    const asked = expect(channel.ask({ t: "topics" })).rejects.toThrow("connection was lost");
    made[0].ends();
    await asked;
  });
});
