import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Forget } from "../../../static/js/drive/forget.js";

describe("the Forget button", () => {
  let button;
  let dialog;
  let send;
  let forget;

  beforeEach(() => {
    document.body.innerHTML = `
      <aside popover><button id="forget">Forget what was seen</button></aside>
      <dialog><form method="dialog">
        <button type="button" data-close>Leave it</button><button>Forget</button>
      </form></dialog>`;
    button = document.getElementById("forget");
    dialog = document.querySelector("dialog");
    dialog.show = vi.fn(() => dialog.setAttribute("open", ""));
    dialog.close = vi.fn(() => dialog.removeAttribute("open"));
    send = vi.fn();
    const parts = { forget: button, "forget-dialog": dialog };
    forget = new Forget({ parts, request: send });
  });

  afterEach(() => forget.close());

  it("asks first, and closes its panel", () => {
    const panel = document.querySelector("aside");
    panel.hidePopover = vi.fn();
    forget.mayAct = true;
    button.click();
    expect(panel.hidePopover).toHaveBeenCalled();
    expect(dialog.show).toHaveBeenCalled();
    expect(send).not.toHaveBeenCalled();
    dialog.querySelector("form").dispatchEvent(new Event("submit"));
    expect(send).toHaveBeenCalledWith({ t: "forget" });
  });

  it("sends nothing when the person cancels", () => {
    button.click();
    dialog.querySelector("[data-close]").click();
    expect(send).not.toHaveBeenCalled();
  });

  it("looks disabled without control", () => {
    expect(button.getAttribute("aria-disabled")).toBe("true");
    forget.mayAct = true;
    expect(button.getAttribute("aria-disabled")).toBeNull();
  });
});
