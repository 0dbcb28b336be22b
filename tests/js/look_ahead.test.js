import { beforeEach, describe, expect, it, vi } from "vitest";
import { LookAhead } from "../../static/js/look_ahead.js";

describe("the button that lets the head look ahead", () => {
  let button;
  let send;
  let look;

  beforeEach(() => {
    button = document.createElement("button");
    button.hidden = true;
    send = vi.fn();
    look = new LookAhead(button, send);
  });

  it("is there for robots with a head only", () => {
    look.facts = { has_head: false };
    expect(button.hidden).toBe(true);
    look.facts = { has_head: true };
    expect(button.hidden).toBe(false);
  });

  it("asks while this tab has control", () => {
    look.fence = 7;
    button.click();
    expect(send).toHaveBeenCalledWith({ t: "look_ahead" });
  });

  it("asks nothing without control", () => {
    button.click();
    look.fence = 7;
    look.fence = null;
    button.click();
    expect(button.disabled).toBe(true);
    expect(send).not.toHaveBeenCalled();
  });
});
