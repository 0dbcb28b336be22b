import { readFileSync } from "node:fs";
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { parts } from "../../../static/js/lib/dom.js";
import { TopicsTab } from "../../../static/js/topics/topics_tab.js";
import { FakeSocket, made } from "../fake_socket.js";

const TWIST = "geometry_msgs/Twist";
const DIALOG = `<dialog data-part="choose-dialog"><h2 data-part="choose-title"></h2>
  <div data-part="choose-list"></div></dialog>`;
const template = readFileSync("templates/teleop/control/tabs/topics.html", "utf8");

describe("the Topics tab of a robot that is slow to answer", () => {
  let tab;
  let notices;
  const emptyOf = (name) => document.querySelector(`[data-part=${name}] > p:last-child`);
  const answers = (socket) => {
    for (const { t, seq } of socket.sent) {
      const topics = [{ name: "/key_vel", type: TWIST }];
      if (t === "topics")
        socket.says(JSON.stringify({ t: "graph", seq, topics, actions: [], services: [] }));
      if (t === "parameters") socket.says(JSON.stringify({ t: "parameters", seq, names: ["/a"] }));
    }
  };

  beforeEach(() => {
    vi.useFakeTimers();
    vi.stubGlobal("WebSocket", FakeSocket);
    FakeSocket.begin();
    document.body.innerHTML = template.replace(/\{%.*?%\}/g, "") + DIALOG;
    notices = [];
    const notify = (notice) => notices.push(notice.text);
    document.body.dataset.topics = "/topics/";
    const page = { root: document.body, parts: parts(document), request: vi.fn(), notify };
    tab = new TopicsTab({ ...page, clock: () => 0 });
    tab.offers = { uses: { drive: { topic: "/key_vel", type: TWIST, chooseable: {} } } };
    tab.mayAct = true;
    tab.show();
    made[0].opens();
  });

  afterEach(() => {
    tab.close();
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  it("says that choosing needs control, once this is known", () => {
    const control = document.querySelector("[data-part=uses-control]");
    const [, change] = document.querySelectorAll("[data-part=uses] button");
    tab.mayAct = null;
    expect(control.hidden).toBe(true);
    tab.mayAct = false;
    expect(control.hidden).toBe(false);
    change.click();
    expect(notices).toEqual(["Take control first."]);
    expect(document.querySelector("dialog").open).toBe(false);
  });

  it("reports the delay once; empty lists say Asking the robot", async () => {
    [...document.querySelectorAll("button")].find((b) => b.textContent === "Change…").click();
    for (const name of ["topic-list", "service-list", "parameter-list", "choose-list"])
      expect([emptyOf(name).textContent, emptyOf(name).hidden]).toEqual([
        "Asking the robot…",
        false,
      ]);
    vi.advanceTimersByTime(2000);
    expect(notices).toEqual(["Topics: no answer within 0.75 s yet. It may take some seconds."]);
    answers(made[0]);
    await vi.waitFor(() => expect(emptyOf("service-list").textContent).toBe("The robot has none."));
    expect(emptyOf("choose-list").hidden).toBe(true);
    expect(document.querySelector("[data-part=choose-list] input").hidden).toBe(false);
  });

  it("reports the delay again when opened again while asking", async () => {
    const refusal = { code: "inspector_silent", text: "Ask again." };
    made[0].says(JSON.stringify({ t: "refused", seq: made[0].sent[0].seq, refusal }));
    answers(made[0]);
    const fault = document.querySelector("[data-part=topics-fault]");
    await vi.waitFor(() => expect(fault.textContent).toBe("Ask again."));
    expect(emptyOf("service-list").textContent).toBe("Asking the robot…"); // the tab sends no new request
    tab.hide();
    notices.length = 0;
    tab.show();
    made[1].opens();
    vi.advanceTimersByTime(750);
    expect(notices).toHaveLength(1);
  });
});
