import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { LiveSocket, socketUrl } from "../../../static/js/connection/socket.js";
import { FakeSocket, made } from "../fake_socket.js";

const early = () => import("../../../static/js/connection/early.js");

describe("the early connection", () => {
  beforeEach(() => {
    vi.resetModules();
    vi.stubGlobal("WebSocket", FakeSocket);
    FakeSocket.begin();
    document.head.innerHTML = '<meta data-opens="/ws/robots/one/">';
    delete window.earlySocket;
  });

  afterEach(() => vi.unstubAllGlobals());

  it("is the page's only one", async () => {
    await early();
    expect(made).toHaveLength(1);
    const live = new LiveSocket(socketUrl("/ws/robots/one/"));
    live.connect();
    expect(made.map(({ url }) => url)).toEqual([socketUrl("/ws/robots/one/")]);
    live.close();
  });

  it("is not made when the page was quicker", async () => {
    const live = new LiveSocket(socketUrl("/ws/robots/one/"));
    live.connect();
    await early();
    expect(made).toHaveLength(1);
    live.close();
  });
});
