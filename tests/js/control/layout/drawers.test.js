import { afterEach, beforeEach, describe, expect, it } from "vitest";
import { Drawers } from "../../../../static/js/control/layout/drawers.js";

describe("drawers", () => {
  let root;
  let drawers;
  const find = (selector) => root.querySelector(selector);
  const opener = (name) => find(`[data-drawer-open="${name}"]`);
  const press = (element, key) =>
    element.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));

  beforeEach(() => {
    document.body.innerHTML = `<main>
      <button data-drawer-open="actions"></button><button data-drawer-open="more"></button>
      <div data-drawer="actions" data-shows="motions"><div class="drawer-head">
        <button data-shows="motions" aria-pressed="true"></button>
        <button data-shows="phrases" aria-pressed="false"></button>
        <button data-drawer-close></button></div></div>
      <div data-drawer="more"></div></main>`;
    root = document.querySelector("main");
    drawers = new Drawers(root);
  });
  afterEach(() => drawers.end());

  it("open one at a time, and close by the same button", () => {
    opener("actions").click();
    expect(root.dataset.drawerShown).toBe("actions");
    opener("more").click();
    expect(root.dataset.drawerShown).toBe("more");
    expect(opener("actions").getAttribute("aria-expanded")).toBe("false");
    expect(opener("more").getAttribute("aria-expanded")).toBe("true");
    opener("more").click();
    expect(root.dataset.drawerShown).toBeUndefined();
  });

  it("give the focus back when they close", () => {
    opener("actions").click();
    const close = find("[data-drawer-close]");
    close.focus();
    press(close, "Escape");
    expect(root.dataset.drawerShown).toBeUndefined();
    expect(document.activeElement).toBe(opener("actions"));
  });

  it("show one of their lists", () => {
    find('.drawer-head [data-shows="phrases"]').click();
    expect(find('[data-drawer="actions"]').dataset.shows).toBe("phrases");
    expect(find('.drawer-head [data-shows="motions"]').getAttribute("aria-pressed")).toBe("false");
  });
});
