import { beforeEach, describe, expect, it, vi } from "vitest";
import { askFirst } from "../../../static/js/calendar/cancel.js";

const PAGE = `
  <form data-asks="Cancel this booking?" data-words="TIAGo One, 10:00" data-yes="Cancel"><button>Cancel</button></form>
  <dialog data-part="cancel-dialog"><form method="dialog"><h2 data-part="cancel-title"></h2>
    <p data-part="cancel-words"></p><button type="button" data-close></button>
    <button data-part="cancel-yes"></button></form></dialog>`;

describe("giving a booking up", () => {
  let form, dialog;
  beforeEach(() => {
    document.body.innerHTML = PAGE;
    dialog = document.querySelector("dialog");
    dialog.show = () => dialog.setAttribute("open", "");
    dialog.close = () => dialog.removeAttribute("open");
    form = document.querySelector("[data-asks]");
    form.submit = vi.fn();
    askFirst(document.body);
    form.requestSubmit();
  });

  it("asks first and says what", () => {
    expect(form.submit).not.toHaveBeenCalled();
    expect(dialog.textContent).toContain("TIAGo One, 10:00");
    dialog.querySelector("[data-close]").click();
    expect(form.submit).not.toHaveBeenCalled();
    expect(dialog.open).toBe(false);
  });

  it("is done after a yes", () => {
    dialog.querySelector("form").dispatchEvent(new Event("submit", { bubbles: true }));
    expect(form.submit).toHaveBeenCalledOnce();
  });
});
