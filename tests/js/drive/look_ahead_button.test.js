import { beforeEach, describe, expect, it, vi } from "vitest";
import { LookAhead } from "../../../static/js/drive/look_ahead_button.js";

describe("the Look ahead button", () => {
  let button;
  let send;
  let look;

  beforeEach(() => {
    button = document.createElement("button");
    button.hidden = true;
    send = vi.fn();
    look = new LookAhead(button, send);
  });

  it("is shown only for robots with a head", () => {
    look.facts = { has_head: false };
    expect(button.hidden).toBe(true);
    look.facts = { has_head: true };
    expect(button.hidden).toBe(false);
  });

  it("sends its request while this tab has control", () => {
    look.mayAct = true;
    button.click();
    expect(send).toHaveBeenCalledWith({ t: "look_ahead" });
  });

  it("looks disabled without control, still sends when pressed", () => {
    expect(button.getAttribute("aria-disabled")).toBe("true");
    look.mayAct = true;
    expect(button.getAttribute("aria-disabled")).toBeNull();
    look.mayAct = false;
    expect(button.getAttribute("aria-disabled")).toBe("true");
    button.click();
    expect(send).toHaveBeenCalled();
  });
});
