import { afterEach, beforeEach, describe, expect, it } from "vitest";
import { keysHelp } from "../../../../static/js/drive/input/keys_help.js";

describe("the list of keys", () => {
  let dialog;
  let opener;
  let end;
  const press = (key, target = document.body) =>
    target.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));

  beforeEach(() => {
    dialog = document.createElement("dialog");
    const close = document.createElement("button");
    close.dataset.close = "";
    dialog.append(close);
    opener = document.createElement("button");
    document.body.replaceChildren(dialog, opener);
    end = keysHelp(dialog, opener);
  });
  afterEach(() => end());

  it("opens by ? or menu, closes by ?, Escape or its button", () => {
    press("?");
    expect(dialog.open).toBe(true);
    press("?");
    expect(dialog.open).toBe(false);
    opener.click();
    press("Escape");
    expect(dialog.open).toBe(false);
    opener.click();
    dialog.querySelector("button").click();
    expect(dialog.open).toBe(false);
  });

  it("ignores a question mark written in a field", () => {
    const field = document.createElement("textarea");
    document.body.append(field);
    press("?", field);
    expect(dialog.open).toBe(false);
  });
});
