import { afterEach, expect, it, vi } from "vitest";
import { Over } from "../../../../static/js/control/layout/over.js";

afterEach(() => vi.unstubAllGlobals());

it("the whole screen of a tablet follows its turns", () => {
  const queries = new Map();
  vi.stubGlobal("matchMedia", (media) => {
    queries.set(media, Object.assign(new EventTarget(), { matches: false }));
    return queries.get(media);
  });
  const root = document.createElement("main");
  const over = new Over(root);
  Object.defineProperty(document, "fullscreenElement", { value: root, configurable: true });
  document.dispatchEvent(new Event("fullscreenchange"));
  expect(root.dataset.over).toBeUndefined();
  const landscape = queries.get("(orientation: landscape)");
  landscape.matches = true;
  landscape.dispatchEvent(new Event("change"));
  expect([root.dataset.over, document.body.dataset.over]).toEqual(["true", "true"]);
  over.close();
  delete document.fullscreenElement;
  delete document.body.dataset.over;
});
