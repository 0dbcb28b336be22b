import { readFileSync } from "node:fs";
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Choices } from "../../../static/js/control/choices.js";
import { parts } from "../../../static/js/lib/dom.js";
import { PlotCell } from "../../../static/js/topics/plot_cell.js";
import { FakeSocket, made } from "../fake_socket.js";

const template = readFileSync("templates/teleop/control/picture/plot.html", "utf8");
const ODOM = { x: 0.5, pose: { covariance: [1, 2] }, frame: "odom" };

describe("a plot beside the pictures", () => {
  let found;
  let cell;
  const begin = (person) => {
    const page = { root: document.body, parts: found, choices: new Choices({ person }) };
    cell = new PlotCell(page);
  };
  const says = (message) => made.at(-1).says(JSON.stringify(message));
  const options = (part) => [...found[part].options].slice(1).map(({ value }) => value);
  const choose = (part, value) => {
    found[part].value = value;
    found[part].dispatchEvent(new Event("change"));
  };
  const subscribed = () =>
    made
      .at(-1)
      .sent.filter(({ t }) => t === "subscribe")
      .map(({ topic }) => topic);

  beforeEach(() => {
    vi.stubGlobal("WebSocket", FakeSocket);
    vi.stubGlobal("fetch", () => Promise.reject(new Error("offline")));
    vi.stubGlobal("matchMedia", () => new EventTarget());
    vi.stubGlobal(
      "ResizeObserver",
      class {
        observe() {}
        disconnect() {}
      },
    );
    FakeSocket.begin();
    document.body.innerHTML = template.replace(/\{[%#].*?[%#]\}/g, "");
    document.body.dataset.topics = "/topics/";
    document.body.dataset.robot = "tiago-1";
    found = parts(document);
  });
  afterEach(() => {
    cell.close();
    vi.unstubAllGlobals();
  });

  it("reads no topic until it is shown", () => {
    begin("ann");
    expect([made.length, found.plot.hidden]).toEqual([0, true]);
    cell.plotShown = true;
    made[0].opens();
    expect([subscribed(), found.plot.hidden]).toEqual([[], false]);
  });

  it("plots the chosen fields of the chosen topic, and keeps them", async () => {
    begin("bo");
    cell.plotShown = true;
    made[0].opens();
    const { seq } = made[0].sent.find(({ t }) => t === "topics");
    const topics = [{ name: "/odom", type: "nav_msgs/Odometry" }];
    says({ t: "graph", seq, topics, actions: [], services: [] });
    await vi.waitFor(() => expect(options("plot-topic")).toEqual(["/odom"]));
    choose("plot-topic", "/odom");
    says({ t: "sample", topic: "/odom", number: 1, fields: ODOM });
    expect(options("plot-field")).toEqual(["x", "pose.covariance[0]", "pose.covariance[1]"]);
    choose("plot-field", "pose.covariance[1]");
    expect([found["plot-words"].hidden, found["plot-lines"].hidden]).toEqual([true, false]);
    cell.close();
    begin("bo");
    cell.plotShown = true;
    made.at(-1).opens();
    expect([subscribed(), found["plot-lines"].hidden]).toEqual([["/odom"], false]);
    found["plot-clear"].click();
    expect(found["plot-lines"].hidden).toBe(true);
  });
});
