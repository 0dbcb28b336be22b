import { afterEach, beforeEach, describe, expect, it } from "vitest";
import { closable } from "../../../static/js/lib/dialog.js";

const news = () => new Promise((resolve) => setTimeout(resolve)); // an observer is told after the change

describe("what lies beside an open dialog", () => {
  const part = (name) => document.querySelector(`.${name}`);
  const isBarred = (name) => part(name).closest("[inert]") !== null;
  let listening;

  beforeEach(() => {
    document.body.innerHTML = `
      <header class="top"><button class="menu"></button></header>
      <main>
        <section class="card"><button class="take"></button><form><button class="stop-button"></button></form></section>
        <p data-part="alarm" class="alarm"></p>
        <dialog class="first"><button data-close class="close"></button></dialog>
        <dialog class="second"><button data-close></button></dialog>
      </main>`;
    listening = new AbortController();
    for (const dialog of document.querySelectorAll("dialog")) closable(dialog, listening.signal);
  });
  afterEach(() => listening.abort());

  it("is barred, except stops, alarms and other dialogs, until the dialog closes", async () => {
    part("first").show();
    await news();
    for (const name of ["menu", "take"]) expect(isBarred(name)).toBe(true);
    for (const name of ["stop-button", "alarm", "close", "second"])
      expect(isBarred(name)).toBe(false);
    part("close").click();
    await news();
    expect(document.querySelector("[inert]")).toBe(null);
  });

  it("stays barred until the last of two dialogs closes", async () => {
    part("first").show();
    await news();
    part("second").show();
    await news();
    part("close").click();
    await news();
    expect(isBarred("take")).toBe(true);
    part("second").close();
    await news();
    expect(document.querySelector("[inert]")).toBe(null);
  });

  it("is free after an Escape for each dialog, also if the focus is beside them", async () => {
    for (const name of ["second", "first"]) {
      part(name).show();
      await news();
    }
    const pressEscape = () =>
      document.activeElement.dispatchEvent(
        new KeyboardEvent("keydown", { key: "Escape", bubbles: true, cancelable: true }),
      );
    document.activeElement.blur();
    pressEscape();
    await news();
    expect([part("first").open, part("second").open]).toEqual([false, true]);
    expect(part("second").contains(document.activeElement)).toBe(true);
    document.activeElement.blur();
    pressEscape();
    await news();
    expect(document.querySelector("dialog[open], [inert]")).toBe(null);
  });

  it("is free again when the page's part ends while the dialog is open", async () => {
    part("first").show();
    await news();
    listening.abort();
    expect(document.querySelector("[inert]")).toBe(null);
  });

  it("gets the focus back", async () => {
    part("take").focus();
    part("first").show();
    part("close").focus();
    await news();
    part("close").click();
    part("close").blur(); // a browser gives the focus to nothing that is barred
    await news();
    expect(document.activeElement).toBe(part("take"));
  });
});
