import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { StopWords } from "../../../../static/js/control/stop/stop_words.js";

describe("the words next to Stop all", () => {
  let element;
  let words;

  beforeEach(() => {
    vi.useFakeTimers();
    element = document.createElement("b");
    words = new StopWords(element);
  });

  afterEach(() => vi.useRealTimers());

  it("disappear some seconds after the newest", () => {
    words.showText("Sending the stop");
    vi.advanceTimersByTime(4000);
    words.showText("Stopped.");
    vi.advanceTimersByTime(4000);
    expect(element.textContent).toBe("Stopped.");
    vi.advanceTimersByTime(1000);
    expect(element.textContent).toBe("");
  });

  it("keep all failures, each once", () => {
    words.showText("Sending the stop");
    words.fail("No answer.", "a");
    words.fail("Not reached: B.", "b");
    words.fail("No answer.", "c");
    vi.advanceTimersByTime(60_000);
    expect(element.textContent).toBe("No answer. Not reached: B.");
  });

  it("interrupt a screen reader only for failures", () => {
    words.showText("Stop sent");
    expect(element.getAttribute("role")).toBe("status");
    words.fail("No answer.");
    expect(element.getAttribute("role")).toBe("alert");
    words.showText("Stopped.");
    expect(element.getAttribute("role")).toBe("status");
  });

  it("name the robots that were not reached in one sentence", () => {
    for (const n of [1, 2]) words.unreached(`TIAGo ${n}`, `tiago-${n}`);
    words.fail("No answer.", "tiago-3");
    expect(element.textContent).toBe(
      "Not reached: TIAGo 1, TIAGo 2. Use the red button on the robot. No answer.",
    );
    words.forget("tiago-1");
    words.fail("Not sent.", "tiago-2");
    expect(element.textContent).toBe("Not sent. No answer.");
  });

  it("show a pending stop until its robot reports it", () => {
    words.unreached("TIAGo 1", "tiago-1", true);
    words.unreached("TIAGo 2", "tiago-2");
    expect(element.textContent).toMatch(
      /^Pending, not confirmed yet: TIAGo 1\..* Not reached: TIAGo 2\./,
    );
    words.delivered("tiago-1");
    words.delivered("tiago-2");
    expect(element.textContent).toBe("Not reached: TIAGo 2. Use the red button on the robot.");
  });

  it("forget a robot's failure when its stop is pressed again", () => {
    for (const slug of ["a", "b", "c"]) words.fail(`Not reached: ${slug}.`, slug);
    words.forget("a");
    expect(element.textContent).toBe("Not reached: b. Not reached: c.");
    words.showText("Stop sent");
    expect(element.textContent).toBe("Stop sent");
    words.forget("b"); // "b" has no failure any more: the text stays
    expect(element.textContent).toBe("Stop sent");
  });
});
