import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { bookingWords, cardOf, doingText, turnWords } from "../../../static/js/fleet/card_words.js";
import { FleetPage } from "../../../static/js/fleet/fleet_page.js";
import { FakeSocket, made } from "../fake_socket.js";

const state = {
  phase: "online",
  text: "",
  stop: { state: "clear", by: null, reason: "", standstill_ms: null },
  verdict: { code: "idle", text: "", limits: [] },
  battery_percent: 83.6,
  charging: true,
  holder: null,
};

describe("a card", () => {
  it("has no news of a robot whose bridge is silent", () => {
    const refusal = { code: "bridge_silent", text: "It says nothing." };
    const shown = cardOf({ state: null, refusal, seen_at: Date.now() / 1000 });
    expect(shown).toMatchObject({ level: "fail", status: "No news", why: "It says nothing." });
    expect(shown.stop).toContain("unknown, last seen");
  });

  it("says that a stop waits for its robot", () => {
    const pending = { by: "Ann", reason: "", at: Date.now() / 1000 };
    const shown = cardOf({ state: null, refusal: { text: "No bridge." }, pending });
    expect(shown.stop).toBe("Pending");
    expect(shown.stopWhy).toContain("A stop by Ann");
    expect(shown.stopped).toBe(false);
  });

  it("says that a robot is out of service, with or without its state", () => {
    const out = { code: "out_of_service", text: "Out until further notice." };
    expect(cardOf({ state: null, refusal: { text: "No bridge." }, out })).toMatchObject({
      level: "warn",
      status: "Out of service",
      why: out.text,
    });
    const shown = cardOf({ state, refusal: null, out });
    expect(shown).toMatchObject({ level: "warn", status: "Out of service", why: out.text });
  });

  it("says that a robot's watchdog is missing", () => {
    const shown = cardOf({ state: { ...state, watchdog_missing: true }, refusal: null });
    expect(shown).toMatchObject({ level: "warn", status: "Online" });
    expect(shown.why).toBe(
      "A safety program is missing: a stop depends on one program alone. Tell staff.",
    );
  });

  it("says that a stopped robot moves", () => {
    const stop = { ...state.stop, state: "stopped", by: "Ann" };
    const moves = { parts: ["base"], speed_mps: 0.3, text: "It drives at 0.3 m/s." };
    const alarm = "The robot moves although it is stopped: press its red button";
    expect(
      cardOf({ state: { ...state, stop, stands: false, moves_although_stopped: moves } }),
    ).toMatchObject({ level: "fail", alarm, doing: alarm, why: "It drives at 0.3 m/s." });
  });

  it("does not say of a stop with silent odometry that the robot stands", () => {
    const stop = { ...state.stop, state: "stopped", by: "Ann", standstill_ms: 300 };
    const shown = cardOf({ state: { ...state, stop, stands: null, unseen_s: 1.5 } });
    expect(shown.doing).toContain("unknown");
    expect(shown.stopWhy).not.toContain("confirmed");
  });

  it("says how the robot is", () => {
    expect(cardOf({ state, refusal: null })).toMatchObject({
      level: "ok",
      status: "Online",
      battery: "84 %, charging",
      driver: "Nobody",
      gate: "Nothing slows it down",
      stop: "Not pressed",
    });
  });

  it.each([
    [{}, "Stands, nobody has control"],
    [{ charging: false, holder: "Ann" }, "Stands, Ann has control"],
    [{ charging: true }, "Charges"],
    [{ odometry: { vx: 0.4, vy: 0, w: 0.2 } }, "Drives at 0.4 m/s"],
    [{ odometry: { vx: -0.1, vy: 0, w: 0 } }, "Reverses at 0.1 m/s"],
    [{ odometry: { vx: 0, vy: 0, w: -0.3 } }, "Turns on the spot"],
    [{ motion: { name: "close_hand" } }, "Moves its arm: close hand"],
    [{ speech: { text: "Good morning." } }, "Says “Good morning.”"],
    [{ drive_by: { who: "Bo" } }, "Drives by itself, for Bo"],
    [{ going: { who: "Bo" } }, "Drives to a place, for Bo"],
    [{ going: { who: "Bo", place: "kitchen" } }, "Drives to “kitchen”, for Bo"],
    [{ stop: { state: "stopped" }, motion: { name: "wave" } }, "Stopped"],
    [{ phase: "waiting" }, "Waiting for the robot"],
  ])("says what the robot does now: %o", (now, words) => {
    expect(doingText({ ...state, charging: false, odometry: null, ...now })).toBe(words);
  });

  it("is old at once when the robot falls silent", () => {
    expect(cardOf({ state: { ...state, unseen_s: 0.3 } }).old).toBe(false);
    expect(cardOf({ state: { ...state, unseen_s: 0.5 } })).toMatchObject({
      old: true,
      level: "fail",
      status: "Robot: no answer",
    });
  });

  it("says why a robot is unreachable", () => {
    const refusal = { text: "Its bridge does not answer." };
    const away = cardOf({ state: null, refusal });
    expect(away).toMatchObject({
      level: "fail",
      why: refusal.text,
      battery: "–",
      stop: "unknown",
      gate: "unknown",
    });
    expect(Object.keys(away).sort()).toEqual(Object.keys(cardOf({ state, refusal: null })).sort());
    const waiting = { ...state, phase: "waiting", text: "No master." };
    expect(cardOf({ state: waiting, refusal: null })).toMatchObject({
      level: "warn",
      why: "No master.",
    });
  });

  it("says when an unreachable robot was last seen", () => {
    const out = { ...state, phase: "waiting", unseen_s: 90 };
    const seen = cardOf({ state: out, refusal: null });
    expect(seen.gate).toMatch(/^unknown, last seen .*\d/);
    expect(seen.stop).toBe(seen.gate);
    expect(seen.battery).toBe("–");
    const pressed = { ...out, stop: { ...state.stop, state: "stopped", by: "Bo" } };
    const latched = cardOf({ state: pressed, refusal: null });
    expect(latched).toMatchObject({ stop: "Pressed", stopped: true });
    expect(latched.stopWhy).toMatch(/^by Bo. Standstill: unknown, last seen/);
    const never = cardOf({ state: null, refusal: null, seen_at: 1.7e9 });
    expect(never.gate).toContain("2023");
  });

  it("says who stopped it and how the robot reacted", () => {
    const stop = { state: "stopped", by: "Bo", reason: "", standstill_ms: 300 };
    expect(cardOf({ state: { ...state, stop }, refusal: null })).toMatchObject({
      stop: "Stopped",
      stopped: true,
      stopWhy: "by Bo. Standstill confirmed after 300 ms.",
    });
  });
});

describe("a card's booking", () => {
  const booked = { name: "Anna", mine: false, seconds: 1200 };
  const next = (seconds) => ({ name: "Ben", mine: false, seconds });

  it.each([
    ["nobody booked", {}, "Free"],
    ["a slot comes", { next_booked: next(1200) }, "Free, Ben in 20 min"],
    ["nobody follows", { booked }, "Anna, 20 min left, then free"],
    [
      "somebody follows at once",
      { booked, next_booked: next(1200), free_in_s: 4800 },
      "Anna, 20 min left, then Ben; free in 1 h 20 min",
    ],
    [
      "others follow all day",
      { booked, next_booked: next(1200), free_in_s: null },
      "Anna, 20 min left, then Ben; booked for a day",
    ],
    ["out of service", { out: {}, free_in_s: null }, "–"],
    ["out of service, for a while", { out: {}, free_in_s: 4800 }, "free in 1 h 20 min"],
    ["somebody follows later", { booked, next_booked: next(3600) }, "Anna, 20 min left, then free"],
  ])("says who has the robot, and when it is free: %s", (_when, robot, words) => {
    expect(bookingWords(robot)).toBe(words);
  });

  it.each([
    [
      { person: "Ada", driving: true, seconds: 250, next: "Ben" },
      "Ada drives, 5 min left · next: Ben",
    ],
    [{ person: "Ada", driving: false, seconds: 80, next: null }, "Ada, it is your turn"],
    [{ person: null, driving: false, seconds: null, next: "Ben" }, "next: Ben"],
    [null, ""],
  ])("says whose turn it is in a lesson", (turn, words) => {
    expect(turnWords({ booked: { turn } })).toBe(words);
  });
});

describe("the fleet page", () => {
  let page;
  let reload;

  const clear = { state, refusal: null };
  const away = { state: null, refusal: { text: "Its bridge is not running." } };
  const stopped = { state: { ...state, stop: { ...state.stop, state: "stopped" } }, refusal: null };
  const part = (name) => document.querySelector(`[data-part=${name}]`);
  const hears = (robots) => made.at(-1).says(JSON.stringify({ t: "fleet", robots }));
  const said = (kind) => made.flatMap(({ sent }) => sent).filter(({ t }) => t === kind);
  const press = (form, slug) =>
    (slug ? document.querySelector(`[data-robot=${slug}]`) : document)
      .querySelector(`[data-part=${form}] button`)
      .dispatchEvent(new Event("pointerdown"));
  const refuses = (refusal) =>
    made.at(-1).says(JSON.stringify({ t: "refused", of: "stop", refusal }));
  const ofCards = (name) =>
    [...document.querySelectorAll(`[data-part=${name}]`)].map(({ textContent }) => textContent);

  const card = (slug, name) => `
    <article data-robot="${slug}">
      <h2 data-part="name">${name}</h2><a href="/robots/${slug}/" id="open-${slug}"></a><span data-part="status"></span><p data-part="why"></p><p data-part="turn"></p><span data-part="recorded"></span>
      <b data-part="doing"></b><b data-part="alarm"></b><b data-part="battery"></b><b data-part="health"></b><b data-part="driver"></b><b data-part="booking"></b><b data-part="gate"></b>
      <b data-part="stop-state"></b><b data-part="stop-why"></b>
      <b data-part="book"></b>
      <form data-part="stop" action="/robots/${slug}/stop/"><button></button></form>
    </article>`;

  function open(numbers = [1]) {
    document.body.innerHTML = `
      <main data-socket="/ws/fleet/">
        <input data-part="search" hidden><p data-part="search-none"></p>
        <span data-part="connection"></span>
        ${numbers.map((n) => card(`tiago-${n}`, `TIAGo ${n}`)).join("")}
      </main>
      <form data-part="stop-all" action="/stop-all/"><b data-part="stop-all-state"></b><button></button></form>`;
    page = new FleetPage(document.querySelector("main"));
    made.at(-1).opens();
  }

  function openThree() {
    page.close();
    open([1, 2, 3]);
  }

  beforeEach(() => {
    vi.useFakeTimers();
    sessionStorage.clear();
    FakeSocket.begin();
    vi.stubGlobal("WebSocket", FakeSocket);
    const answer = { ok: true, json: async () => ({ text: "Stopped." }) };
    vi.stubGlobal(
      "fetch",
      vi.fn(async () => answer),
    );
    reload = vi.spyOn(location, "reload").mockImplementation(() => {});
    open();
  });

  afterEach(() => {
    page.close();
    document.body.replaceChildren();
    vi.restoreAllMocks();
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  it("opens the only search hit with Enter", () => {
    openThree();
    const opened = vi.fn();
    for (const link of document.querySelectorAll("a"))
      link.addEventListener("click", (event) => {
        event.preventDefault();
        opened(link.id);
      });
    const field = part("search");
    const shown = () =>
      [...document.querySelectorAll("article")].filter(({ hidden }) => !hidden).length;
    const press = (key) => field.dispatchEvent(new KeyboardEvent("keydown", { key }));
    const type = (text) => {
      field.value = text;
      field.dispatchEvent(new Event("input"));
    };
    expect(field.hidden).toBe(false);
    type("tiágo");
    press("Enter");
    expect([shown(), opened.mock.calls.length]).toEqual([3, 0]);
    type("2 TIA");
    press("Enter");
    expect([shown(), opened.mock.calls]).toEqual([1, [["open-tiago-2"]]]);
    type("x");
    expect([shown(), part("search-none").hidden]).toEqual([0, false]);
    press("Escape");
    expect([shown(), field.value]).toEqual([3, ""]);
  });

  it.each([
    ["for good", null],
    ["for a while", 4800],
  ])(
    "offers to book a robot that is out of service %s only if it will be free",
    (_when, freeInS) => {
      hears({ "tiago-1": { ...clear, out: { text: "Repair." }, free_in_s: freeInS } });
      expect(part("book").hidden).toBe(freeInS === null);
    },
  );

  it("keeps the robots that an update leaves out", () => {
    openThree();
    hears({ "tiago-1": clear, "tiago-2": stopped, "tiago-3": stopped });
    press("stop-all");
    vi.advanceTimersByTime(100);
    made.at(-1).says(JSON.stringify({ t: "fleet", robots: { "tiago-1": stopped }, changed: true }));
    expect(reload).not.toHaveBeenCalled();
    expect(ofCards("stop-state")).toEqual(["Stopped", "Stopped", "Stopped"]);
    vi.advanceTimersByTime(400);
    expect(fetch).not.toHaveBeenCalled(); // all are stopped: the press is answered
    hears({ "tiago-1": clear });
    expect(reload).toHaveBeenCalled(); // all robots that are left
  });

  it("posts no form when the robots report the stop", () => {
    hears({ "tiago-1": clear });
    press("stop");
    press("stop-all");
    expect(said("stop")).toEqual([{ t: "stop", slug: "tiago-1" }]);
    vi.advanceTimersByTime(100);
    hears({ "tiago-1": stopped });
    vi.advanceTimersByTime(400);
    expect(fetch).not.toHaveBeenCalled();
    expect(part("stop-state").textContent).toBe("Stopped");
  });

  it.each([
    ["stop", "/robots/tiago-1/stop/", "stop-state"],
    ["stop-all", "/stop-all/", "stop-all-state"],
  ])("does not take an old report for an answer (%s)", async (form, address, region) => {
    hears({ "tiago-1": stopped }); // the last report: after it, another person clears the stop
    press(form);
    expect(part(region).textContent).toBe("Stop sent, waiting for the robot");
    await vi.advanceTimersByTimeAsync(400);
    expect(fetch.mock.calls.map(([url]) => new URL(url).pathname)).toEqual([address]);
    expect(part(region).textContent).toBe("Stopped.");
  });

  it.each(["stop", "stop-all"])("sends both ways at once after a long silence (%s)", (form) => {
    hears({ "tiago-1": stopped });
    vi.advanceTimersByTime(600);
    expect(part("connection").textContent).toBe("No news");
    press(form);
    expect(said(form.replace("-", "_"))).toHaveLength(1);
    expect(fetch).toHaveBeenCalledTimes(1);
  });

  it("sends both ways at once before the first news", () => {
    vi.advanceTimersByTime(500);
    expect(part("connection").textContent).toBe("Connecting");
    press("stop-all");
    expect(fetch).toHaveBeenCalledTimes(1);
  });

  it("shows an unconfirmed stop on the card and at the edge", async () => {
    const answer = { ok: false, json: async () => ({ text: "Not reached: TIAGo 1." }) };
    fetch.mockResolvedValue(answer);
    press("stop");
    await vi.advanceTimersByTimeAsync(0);
    expect(part("stop-state").textContent).toBe("Not confirmed");
    expect(part("stop-all-state").textContent).toBe("Not reached: TIAGo 1.");
    press("stop");
    expect(part("stop-all-state").textContent).toBe("");
  });

  it.each([true, false])(
    "hides the news of Stop all after some seconds (live: %s)",
    async (live) => {
      if (live) hears({ "tiago-1": clear });
      press("stop-all");
      vi.advanceTimersByTime(100);
      if (live) hears({ "tiago-1": stopped });
      await vi.advanceTimersByTimeAsync(4500);
      expect(part("stop-all-state").textContent).toBe("Stopped.");
      await vi.advanceTimersByTimeAsync(1000);
      expect(part("stop-all-state").textContent).toBe("");
    },
  );

  it("shows what Stop all missed until it is pressed again", async () => {
    const answer = { ok: false, json: async () => ({ text: "Not reached: TIAGo 2." }) };
    fetch.mockResolvedValueOnce(answer);
    press("stop-all");
    await vi.advanceTimersByTimeAsync(60_000);
    expect(part("stop-all-state").textContent).toBe("Not reached: TIAGo 2.");
    press("stop");
    await vi.advanceTimersByTimeAsync(60_000);
    expect(part("stop-all-state").textContent).toBe("Not reached: TIAGo 2.");
    press("stop-all");
    await vi.advanceTimersByTimeAsync(0);
    expect(part("stop-all-state").textContent).toBe("Stopped.");
    await vi.advanceTimersByTimeAsync(60_000);
    expect(part("stop-all-state").textContent).toBe("");
  });

  it("names robots that Stop all missed until the next press", () => {
    openThree();
    hears({ "tiago-1": clear, "tiago-2": away, "tiago-3": away });
    press("stop-all");
    for (const slug of ["tiago-2", "tiago-3"]) refuses({ figures: { slug } });
    hears({ "tiago-1": stopped, "tiago-2": away, "tiago-3": away });
    expect(part("stop-all-state").textContent).toBe(
      "Not reached: TIAGo 2, TIAGo 3. Use the red button on the robot.",
    );
    expect(ofCards("stop-state")).toEqual(["Stopped", "Not confirmed", "Not confirmed"]);
    vi.advanceTimersByTime(300);
    press("stop", "tiago-3");
    expect(part("stop-all-state").textContent).toBe(
      "Not reached: TIAGo 2. Use the red button on the robot.",
    );
    press("stop-all");
    expect(part("stop-all-state").textContent).toBe("Stop sent, waiting for the robot");
  });

  it("names a missed robot once, though both ways missed it", async () => {
    openThree();
    const refused = { code: "bridge_down" };
    const robots = { "tiago-1": { stop: {} }, "tiago-2": refused, "tiago-3": refused };
    const text = "Not reached: TIAGo 2, TIAGo 3. Use the red button on the robot.";
    fetch.mockResolvedValue({ ok: false, json: async () => ({ text, robots }) });
    press("stop-all"); // no report has come yet: the page sends both ways at once
    refuses({ figures: { slug: "tiago-3" } });
    await vi.advanceTimersByTimeAsync(0);
    refuses({ figures: { slug: "tiago-2" } });
    expect(part("stop-all-state").textContent).toBe(
      "Not reached: TIAGo 3, TIAGo 2. Use the red button on the robot.",
    );
    expect(ofCards("stop-state")).toEqual(["", "Not confirmed", "Not confirmed"]);
  });

  it("names the robot of a failed stop after other presses", () => {
    openThree();
    hears({ "tiago-1": clear, "tiago-2": away, "tiago-3": clear });
    press("stop", "tiago-2");
    press("stop", "tiago-3");
    refuses({ figures: { slug: "tiago-2" } });
    expect(part("stop-all-state").textContent).toContain("TIAGo 2");
    press("stop", "tiago-3");
    expect(part("stop-all-state").textContent).toContain("TIAGo 2");
    press("stop", "tiago-2");
    expect(part("stop-all-state").textContent).toBe("");
  });

  it("shows the robot's own report again when it is back", () => {
    openThree();
    hears({ "tiago-1": clear, "tiago-2": away, "tiago-3": clear });
    refuses({ figures: { slug: "tiago-2" } });
    hears({ "tiago-1": clear, "tiago-2": clear, "tiago-3": clear });
    hears({ "tiago-1": clear, "tiago-2": away, "tiago-3": clear });
    expect(ofCards("stop-state")).toEqual(["Not pressed", "unknown", "Not pressed"]);
  });

  it("shows the server's words for an unknown robot", () => {
    refuses({ text: "There is no such robot." });
    expect(part("stop-all-state").textContent).toBe("There is no such robot.");
  });

  it("gives up a silent connection and connects again", () => {
    hears({ "tiago-1": clear });
    vi.advanceTimersByTime(6500);
    expect(said("ping").length).toBeGreaterThan(0);
    expect(made).toHaveLength(2);
    made[1].opens();
    expect(part("connection").textContent).toBe("Connecting");
    hears({ "tiago-1": clear });
    expect(part("connection").textContent).toBe("Connected");
  });

  it("reloads once when the first news lists other robots", () => {
    hears({ "tiago-1": clear, "tiago-2": clear });
    expect(reload).toHaveBeenCalledTimes(1);
    page.close();
    open();
    hears({ "tiago-2": clear, "tiago-1": clear });
    expect(reload).toHaveBeenCalledTimes(1);
    hears({ "tiago-1": clear });
    hears({});
    expect(reload).toHaveBeenCalledTimes(2);
  });
});
