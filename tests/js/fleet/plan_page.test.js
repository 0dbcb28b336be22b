import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { PlanPage } from "../../../static/js/fleet/plan_page.js";
import { whereText, whyNowhere } from "../../../static/js/fleet/plan_words.js";
import { corners, toPixels, whole } from "../../../static/js/navigation/map_frame.js";
import { FakeSocket, made } from "../fake_socket.js";
import { point } from "../hand/events.js";

const KITCHEN = { number: 1, name: "kitchen", x: 1, y: 1, heading: 0 };
const SIDES = {
  width: 100,
  height: 80,
  resolution_m: 0.1,
  origin_x_m: -2,
  origin_y_m: -2,
  origin_rad: 0,
};
const MAP = { ...SIDES, map: "abc", name: "Office", robots: ["one", "two"], places: [KITCHEN] };
const LOCATION = { x: 1.2, y: 1, heading: 0, sigma_m: 0, sigma_across_m: 0, problem: "" };
const STATE = {
  phase: "online",
  stop: { state: "clear" },
  verdict: { code: "idle", text: "" },
  battery_percent: 80,
  odometry: { vx: 0, vy: 0, w: 0 },
  holder: "Ann",
  location: LOCATION,
};
const PEN = new Proxy({}, { get: () => () => {}, set: () => true });
const ROW = `<h3><a href="/robots/x/">Robot</a><span data-part="status"></span></h3><p data-part="doing"></p><p data-part="alarm"></p>
  <p data-part="where"></p><b data-part="driver"></b><b data-part="battery"></b>`;

describe("the fleet map", () => {
  let page;
  let answer;
  const row = (slug) => document.querySelector(`[data-robot=${slug}]`);
  const text = (slug, part) => row(slug).querySelector(`[data-part=${part}]`).textContent;
  const tell = (robots) => made[0].says(JSON.stringify({ t: "fleet", robots }));

  beforeEach(() => {
    vi.stubGlobal("WebSocket", FakeSocket);
    FakeSocket.begin();
    vi.stubGlobal(
      "ResizeObserver",
      class {
        observe() {}
        disconnect() {}
      },
    );
    vi.stubGlobal("requestAnimationFrame", () => 1);
    vi.stubGlobal(
      "Image",
      class {
        async decode() {}
      },
    );
    answer = { ok: true, maps: [MAP, { ...MAP, map: "old", robots: [] }] };
    vi.stubGlobal("fetch", async () => ({ ok: answer.ok, json: async () => answer }));
    HTMLCanvasElement.prototype.getContext = () => PEN;
    const rows = ["one", "two", "three"].map((slug) => `<li data-robot="${slug}">${ROW}</li>`);
    document.body.innerHTML = `<main data-socket="/ws/fleet/" data-help="Map"><span data-part="connection"></span>
      <p data-part="maps-failed" hidden></p><div data-part="maps"></div>
      <section data-part="rest"><ul data-part="rest-list">${rows.join("")}</ul></section></main>`;
  });
  afterEach(() => {
    page.close();
    vi.unstubAllGlobals();
  });

  async function opened() {
    page = new PlanPage(document.querySelector("main"));
    made[0].opens();
    await vi.waitFor(() => expect(document.querySelectorAll(".plan-map").length).toBe(1));
  }

  it("puts robots beside their map, and says of the others why they are on none", async () => {
    await opened();
    const refusal = { code: "bridge_down", text: "Its bridge is away." };
    tell({
      one: { state: STATE },
      two: { state: { ...STATE, location: null } },
      three: { refusal },
    });
    expect(row("one").closest(".plan-map").querySelector("h2").textContent).toBe("Office");
    expect(text("one", "where")).toBe("At “kitchen”");
    expect(text("one", "driver")).toBe("Ann");
    const rest = document.querySelector("[data-part=rest-list]");
    expect([row("two").parentElement, row("three").parentElement]).toEqual([rest, rest]);
    expect(text("two", "where")).toContain("does not know where it is");
    expect(text("three", "where")).toBe("Its bridge is away.");
    tell({ one: { state: STATE }, two: { state: STATE } });
    expect(row("two").closest(".plan-map")).not.toBeNull();
    expect(row("three").hidden).toBe(true); // the person may no longer see this robot
    expect(document.querySelector("[data-part=rest]").hidden).toBe(true);
  });

  it("keeps the robots that an update leaves out", async () => {
    await opened();
    tell({ one: { state: STATE }, two: { state: STATE } });
    const update = { t: "fleet", robots: { two: { state: null } }, changed: true };
    made[0].says(JSON.stringify(update));
    expect(row("one").closest(".plan-map")).not.toBeNull();
    expect(row("two").closest(".plan-map")).toBeNull();
    expect([row("one").hidden, row("two").hidden, row("three").hidden]).toEqual([
      false,
      false,
      true,
    ]);
  });

  it("leads to the page of a robot that is pressed on the map", async () => {
    await opened();
    tell({ one: { state: STATE } });
    const canvas = document.querySelector(".plan-map canvas");
    Object.defineProperties(canvas, { clientWidth: { value: 400 }, clientHeight: { value: 300 } });
    const link = document.querySelector(".plan-picked");
    const pressed = (x, y) => {
      for (const type of ["pointerdown", "pointerup", "click"])
        point(canvas, type, { clientX: x, clientY: y });
    };
    expect(link.hidden).toBe(true);
    pressed(...toPixels(whole(corners(MAP), 400, 300), [LOCATION.x, LOCATION.y], 400, 300));
    expect([link.textContent, new URL(link.href).pathname]).toEqual(["Open Robot", "/robots/x/"]);
    pressed(5, 5);
    expect(link.hidden).toBe(true);
  });

  it("says that maps cannot be read, and lists all robots", async () => {
    answer = { ok: false, detail: "Not now." };
    page = new PlanPage(document.querySelector("main"));
    made[0].opens();
    const failed = document.querySelector("[data-part=maps-failed]");
    await vi.waitFor(() => expect(failed.textContent).toBe("Not now."));
    tell({ one: { state: STATE } });
    expect(text("one", "where")).toContain("has no map of it");
  });
});

describe("words of the fleet map", () => {
  it("name places", () => {
    expect(whereText({ ...LOCATION, x: 2.5 }, [KITCHEN])).toBe("Near “kitchen”");
    expect(whereText({ ...LOCATION, x: 4 }, [KITCHEN])).toBe("At 4.0 m, 1.0 m of the map");
    expect(whereText({ ...LOCATION, problem: "It is lost." }, [KITCHEN])).toBe("It is lost.");
    expect(whyNowhere(null, { state: STATE })).toContain("no map");
    expect(whyNowhere(MAP, { state: STATE })).toBe("");
  });
});
