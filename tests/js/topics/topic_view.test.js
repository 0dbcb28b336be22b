import { beforeEach, describe, expect, it, vi } from "vitest";
import { TopicView } from "../../../static/js/topics/topic_view.js";

vi.mock("../../../static/js/plots/uplot.js", () => ({
  Plot: class {
    redraw() {}
    slide() {}
    close() {}
  },
}));

const TYPE = "std_msgs/Float64";

function shown(number, fields, rest = {}) {
  return { topic: "/a", type: TYPE, number, rate_hz: 1, bytes: 8, publishers: 1, fields, ...rest };
}

describe("the view of a topic", () => {
  let watch;
  const table = () => watch.element.querySelector("dl");
  const button = (label) => table().querySelector(`button[aria-label="${label}"]`);

  beforeEach(() => {
    watch = new TopicView("/a", TYPE);
    document.body.replaceChildren(watch.element);
  });

  it("keeps the known type until a message brings another", () => {
    watch.show(shown(0, {}, { type: "*", refusal: { text: "No message has come on /a yet." } }));
    expect(watch.element.querySelector("h3").textContent).toContain(TYPE);
    expect(watch.element.querySelector(".why").textContent).toContain("No message has come");
    watch.show(shown(1, { data: "x" }, { type: "std_msgs/String" }));
    expect(watch.element.querySelector("h3").textContent).toContain("std_msgs/String");
  });

  it("gives the whole length of a shortened list", () => {
    const fields = { ranges: [1, 2], constructor: [3] };
    watch.show(shown(1, fields, { shortened: { ranges: 666 } }));
    expect(table().textContent).toContain("[1, 2, … (666)]");
    expect(table().textContent).toContain("[3]");
  });

  it("keeps existing rows when others come between them", () => {
    const list = (...xs) => ({ list: xs.map((x) => ({ x })), last: 1 });
    watch.show(shown(1, list(1)));
    const before = button("Plot last");
    before.focus();
    watch.show(shown(2, list(1, 2, 3)));
    watch.show(shown(3, list(7)));
    expect(button("Plot last")).toBe(before);
    expect(document.activeElement).toBe(before);
    expect([...table().querySelectorAll("dt")].map((dt) => dt.textContent)).toEqual([
      "list",
      "list[0]",
      "x",
      "last",
    ]);
    expect(table().textContent).toContain("7");
  });

  it("says when messages stop, until the next one", () => {
    vi.useFakeTimers();
    watch.show(shown(1, { data: 1 }));
    expect(watch.element.dataset.stale).toBe(undefined);
    vi.advanceTimersByTime(4000);
    expect(watch.element.dataset.stale).toBe("true");
    expect(watch.element.textContent).toContain("No new data");
    watch.show(shown(1, { data: 1 }));
    expect(watch.element.dataset.stale).toBe(undefined);
    expect(watch.element.textContent).not.toContain("No new data");
    vi.useRealTimers();
  });

  it("shows any text as plain text", () => {
    const text = "<img src=x onerror=alert(1)>\u0000\n\u202eabc";
    watch.show(shown(1, { data: text }));
    expect(table().querySelector("img")).toBe(null);
    expect(table().querySelector("dd span").textContent).toBe(text);
  });

  it("opens a list of numbers, so that its elements can be plotted", () => {
    watch.show(shown(1, { position: [0.5, "NaN"] }));
    expect(button("Plot position[0]")).toBe(null);
    button("Elements of position").click();
    button("Plot position[0]").click();
    expect(button("Plot position[0]").getAttribute("aria-pressed")).toBe("true");
    expect(watch.element.querySelector(".plot").hidden).toBe(false);
    button("Elements of position").click(); // this also removes the lines of the elements
    expect(button("Plot position[0]")).toBe(null);
    expect(watch.element.querySelector(".plot").hidden).toBe(true);
  });

  it("has at most six lines in a plot, and says so", () => {
    const refused = vi.fn();
    watch.addEventListener("refused", ({ detail }) => refused(detail));
    watch.show(shown(1, { list: [1, 2, 3, 4, 5, 6, 7] }));
    button("Elements of list").click();
    for (let i = 0; i < 7; i += 1) button(`Plot list[${i}]`).click();
    expect(refused).toHaveBeenCalledExactlyOnceWith("A plot has at most 6 lines.");
    expect(button("Plot list[6]").getAttribute("aria-pressed")).toBe("false");
  });

  it("says that a message has more fields than are shown", () => {
    const fields = Object.fromEntries(Array.from({ length: 500 }, (_, i) => [`f${i}`, i]));
    watch.show(shown(1, fields));
    expect(watch.element.textContent).toContain("Only the first 400 fields are shown.");
  });
});
