import { beforeEach, describe, expect, it, vi } from "vitest";
import { LookAhead } from "../../../static/js/drive/look_ahead.js";

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
    look.mayAct = true;
    button.click();
    expect(send).toHaveBeenCalledWith({ t: "look_ahead" });
  });

  it("looks as if it did nothing without control; pressed all the same, the page tells why", () => {
    expect(button.getAttribute("aria-disabled")).toBe("true");
    look.mayAct = true;
    expect(button.getAttribute("aria-disabled")).toBeNull();
    look.mayAct = false;
    expect(button.getAttribute("aria-disabled")).toBe("true");
    button.click();
    expect(send).toHaveBeenCalled();
  });
});
