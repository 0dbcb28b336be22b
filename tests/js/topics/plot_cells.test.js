import { readFileSync } from "node:fs";
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { parts } from "../../../static/js/lib/dom.js";
import { PlotCells } from "../../../static/js/topics/plot_cells.js";
import { FakeSocket, made } from "../fake_socket.js";

const template = readFileSync("templates/teleop/control/picture/plot.html", "utf8");
const ODOM = { x: 0.5, pose: { covariance: [1, 2] }, frame: "odom" };

describe("plots beside the pictures", () => {
  let plots;
  let told;
  let cells;
  const shown = () => [...document.querySelectorAll(".plot-cell")];
  const part = (at, name) => parts(shown()[at])[name];
  const says = (message) => made.at(-1).says(JSON.stringify(message));
  const options = (at, name) => [...part(at, name).options].slice(1).map(({ value }) => value);
  const choose = (at, name, value) => {
    part(at, name).value = value;
    part(at, name).dispatchEvent(new Event("change"));
  };
  const asked = (kind) =>
    made
      .at(-1)
      .sent.filter(({ t }) => t === kind)
      .map(({ topic }) => topic);
  const open = (cells) => {
    plots.cells = cells;
    plots.plotShown = true;
    made[0].opens();
  };

  const offer = async (name) => {
    const { seq } = made[0].sent.find(({ t }) => t === "topics");
    says({ t: "graph", seq, topics: [{ name }], actions: [], services: [] });
    await vi.waitFor(() => expect(options(0, "plot-topic")).toEqual([name]));
  };

  beforeEach(() => {
    vi.stubGlobal("WebSocket", FakeSocket);
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
    told = [];
    const tell = (news) => {
      told.push(news.plotted);
      cells = cells.with(news.plotted.at, news.plotted.content); // as the layout does
      plots.cells = cells;
    };
    plots = new PlotCells({ root: document.body, parts: parts(document), tell });
  });
  afterEach(() => {
    plots.close();
    vi.unstubAllGlobals();
  });

  it("read no topic until they are shown", () => {
    plots.cells = ["camera", "plot /odom x"];
    expect([made.length, shown().length]).toEqual([0, 1]);
    plots.plotShown = true;
    made[0].opens();
    expect(asked("subscribe")).toEqual(["/odom"]);
  });

  it("have the fields that a person chooses, and tell the layout", async () => {
    cells = ["camera", "plot"];
    open(cells);
    await offer("/odom");
    choose(0, "plot-topic", "/odom");
    expect(part(0, "plot-words").textContent).toContain("No message");
    says({ t: "sample", topic: "/odom", number: 1, fields: ODOM });
    expect(options(0, "plot-field")).toEqual(["x", "pose.covariance[0]", "pose.covariance[1]"]);
    choose(0, "plot-field", "pose.covariance[1]");
    choose(0, "plot-field", "x");
    expect(told.at(-1)).toEqual({ at: 1, content: "plot /odom pose.covariance[1] x" });
    expect([part(0, "plot-words").hidden, part(0, "plot-lines").hidden]).toEqual([true, false]);
    part(0, "plot-clear").click();
    expect(told.at(-1)).toEqual({ at: 1, content: "plot /odom" });
    expect(part(0, "plot-lines").hidden).toBe(true);
  });

  it("share the subscription of a topic, and keep their lines at another place", async () => {
    cells = ["plot /odom x", "plot", "plan"];
    open(cells);
    await offer("/odom");
    says({ t: "sample", topic: "/odom", number: 1, fields: ODOM });
    const [first] = shown();
    choose(1, "plot-topic", "/odom"); // it gets the newest message, although no other comes
    expect(options(1, "plot-field")).toContain("x");
    plots.cells = ["plan", "plot /odom", "plot /odom x"];
    expect([shown()[0], first.dataset.cell]).toEqual([first, "c"]);
    expect(asked("subscribe")).toEqual(["/odom"]);
    plots.cells = ["plan", "plot /odom"];
    expect([shown().length, asked("unsubscribe")]).toEqual([1, []]);
    plots.cells = null;
    expect([shown().length, asked("unsubscribe")]).toEqual([0, ["/odom"]]);
  });
});
