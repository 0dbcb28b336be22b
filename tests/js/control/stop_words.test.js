import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { StopWords } from "../../../static/js/control/stop_words.js";

describe("the words beside Stop all", () => {
  let element;
  let words;

  beforeEach(() => {
    vi.useFakeTimers();
    element = document.createElement("b");
    words = new StopWords(element);
  });

  afterEach(() => vi.useRealTimers());

  it("go after some seconds, each time from the last", () => {
    words.say("Sending the stop");
    vi.advanceTimersByTime(4000);
    words.say("Stopped.");
    vi.advanceTimersByTime(4000);
    expect(element.textContent).toBe("Stopped.");
    vi.advanceTimersByTime(1000);
    expect(element.textContent).toBe("");
  });

  it("stay when they are of a failure, also of several, each said once", () => {
    words.say("Sending the stop");
    words.fail("No answer.", "a");
    words.fail("Not reached: B.", "b");
    words.fail("No answer.", "c");
    vi.advanceTimersByTime(60_000);
    expect(element.textContent).toBe("No answer. Not reached: B.");
  });

  it("interrupt a screen reader with failures, and with nothing else", () => {
    words.say("Stop sent");
    expect(element.getAttribute("role")).toBe("status");
    words.fail("No answer.");
    expect(element.getAttribute("role")).toBe("alert");
    words.say("Stopped.");
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

  it("tell of a stop that is pending until its robot reports it", () => {
    words.unreached("TIAGo 1", "tiago-1", true);
    words.unreached("TIAGo 2", "tiago-2");
    expect(element.textContent).toMatch(
      /^Pending, not confirmed yet: TIAGo 1\..* Not reached: TIAGo 2\./,
    );
    words.delivered("tiago-1");
    words.delivered("tiago-2");
    expect(element.textContent).toBe("Not reached: TIAGo 2. Use the red button on the robot.");
  });

  it("forget the failure of what is pressed again, and all of them with Stop all", () => {
    for (const slug of ["a", "b", "c"]) words.fail(`Not reached: ${slug}.`, slug);
    words.forget("a");
    expect(element.textContent).toBe("Not reached: b. Not reached: c.");
    words.say("Stop sent");
    expect(element.textContent).toBe("Stop sent");
    words.forget("b"); // of which there is nothing to forget: the news stays
    expect(element.textContent).toBe("Stop sent");
  });
});
