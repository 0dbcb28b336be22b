import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { parts } from "../../../static/js/lib/dom.js";
import { Lichtblick } from "../../../static/js/topics/lichtblick.js";

const settled = () => vi.advanceTimersByTimeAsync(0);

describe("Open in Lichtblick", () => {
  let panel;
  let named;
  let asked;

  function build({ served = true } = {}) {
    document.body.innerHTML = `
      <main data-tickets="/tickets/" data-lichtblick="/lichtblick/">
        <button data-part="lichtblick-open"></button><button data-part="topics-lichtblick"></button>
        <dialog data-part="lichtblick-dialog">
          ${served ? '<a data-part="lichtblick-link"></a>' : ""}
          <input data-part="lichtblick-address" readonly>
          <button data-part="lichtblick-copy" data-copied="Copied" data-failed="Selected">Copy</button>
          <p data-part="lichtblick-fault" hidden></p>
          <button data-close></button>
        </dialog>
      </main>`;
    const root = document.querySelector("main");
    named = parts(root);
    const dialog = named["lichtblick-dialog"];
    dialog.show = vi.fn(() => dialog.setAttribute("open", ""));
    dialog.close = vi.fn(() => {
      dialog.removeAttribute("open");
      dialog.dispatchEvent(new Event("close"));
    });
    panel = new Lichtblick({ root, parts: named });
  }

  beforeEach(() => {
    vi.useFakeTimers();
    asked = [];
    vi.stubGlobal("fetch", async (address, { method, body }) => {
      asked.push([method, address, JSON.parse(body)]);
      const path = `/foxglove/tiago-1?ticket=t${asked.length}`;
      return new Response(JSON.stringify({ path }), { status: 201 });
    });
  });

  afterEach(() => {
    panel.close();
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  it("asks for tickets only when it is opened", async () => {
    build();
    await vi.advanceTimersByTimeAsync(60_000);
    expect(asked).toEqual([]);
    named["topics-lichtblick"].click();
    await settled();
    expect(asked[0]).toEqual(["POST", "/tickets/", { door: "foxglove" }]);
    expect(named["lichtblick-dialog"].open).toBe(true);
  });

  it("gives the link and the field tickets of their own", async () => {
    build();
    named["lichtblick-open"].click();
    await settled();
    expect(named["lichtblick-address"].value).toMatch(/^ws:\/\/.+\/foxglove\/tiago-1\?ticket=t1$/);
    const link = new URL(named["lichtblick-link"].href, "http://here/");
    expect(link.pathname).toBe("/lichtblick/");
    expect(link.searchParams.get("ds")).toBe("foxglove-websocket");
    expect(link.searchParams.get("ds.url")).toMatch(/\/foxglove\/tiago-1\?ticket=t2$/);
    named["lichtblick-link"].click();
    await settled();
    expect(named["lichtblick-link"].href).toContain("t3");
    expect(named["lichtblick-address"].value).toContain("t1");
  });

  it("renews them while it is open, but not what is being copied", async () => {
    build({ served: false });
    named["lichtblick-open"].click();
    await vi.advanceTimersByTimeAsync(30_000);
    expect(named["lichtblick-address"].value).toContain("t2");
    named["lichtblick-address"].focus();
    await vi.advanceTimersByTimeAsync(30_000);
    expect(named["lichtblick-address"].value).toContain("t2");
    named["lichtblick-dialog"].close();
    await vi.advanceTimersByTimeAsync(120_000);
    expect(asked.length).toBe(2);
  });

  it("copies the address", async () => {
    build();
    const writeText = vi.fn(async () => {});
    vi.stubGlobal("navigator", { clipboard: { writeText } });
    named["lichtblick-open"].click();
    await settled();
    named["lichtblick-copy"].click();
    await settled();
    expect(writeText).toHaveBeenCalledWith(named["lichtblick-address"].value);
    expect(named["lichtblick-copy"].textContent).toBe("Copied");
    await vi.advanceTimersByTimeAsync(30_000);
    expect(named["lichtblick-copy"].textContent).toBe("Copy");
  });

  it("says why there is no address", async () => {
    vi.stubGlobal("fetch", async () => new Response('{"detail": "Signed out."}', { status: 401 }));
    build();
    named["lichtblick-open"].click();
    await settled();
    expect(named["lichtblick-fault"].textContent).toBe("Signed out.");
    expect(named["lichtblick-fault"].hidden).toBe(false);
  });
});
