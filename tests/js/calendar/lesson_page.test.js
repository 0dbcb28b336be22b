import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { LessonPage } from "../../../static/js/calendar/lesson_page.js";
import { FakeSocket, made } from "../fake_socket.js";

const stop = '<form data-stop action="/robots/one/stop/"><button>Stop</button></form>';
const turn = (id, name) => `<form action="/l/"><input name="turn" value="${id}"><p>${name}</p>
  <button name="action" value="skip">Skip</button></form>`;
const pageOf = (lines) => `<main data-socket="/ws/bookings/"><p data-part="news" hidden></p>
  <div data-part="live">${stop}<span data-left="65"></span>${lines}</div></main>`;

describe("the page of a lesson", () => {
  let page;
  let answers;
  const live = () => document.querySelector("[data-part=live]");
  const answer = (html) => ({
    ok: true,
    url: "/l/",
    headers: new Headers({ "Content-Type": "text/html" }),
    text: async () => html,
  });
  const changed = async (turns = true) => {
    made[0].says(JSON.stringify({ t: "bookings_changed", turns }));
    await vi.advanceTimersByTimeAsync(600);
  };

  beforeEach(() => {
    vi.useFakeTimers();
    vi.stubGlobal("WebSocket", FakeSocket);
    FakeSocket.begin();
    answers = [];
    vi.stubGlobal(
      "fetch",
      vi.fn(async () => answers.shift() ?? null),
    );
    document.body.innerHTML = pageOf(turn(1, "Ada") + turn(2, "Ben"));
    page = new LessonPage(document.querySelector("main"), "/l/");
    made[0].opens();
  });
  afterEach(() => {
    page.close();
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  it("follows the line by hints, and keeps the focus and the stop's button", async () => {
    const held = live().querySelector("[data-stop]");
    live().querySelector('[value="2"] ~ button').focus();
    answers = [answer(pageOf(turn(2, "Ben drives")))];
    await changed();
    expect(live().textContent).toContain("Ben drives");
    expect(live().querySelector("[data-stop]")).toBe(held);
    expect(document.activeElement.closest("form").textContent).toContain("Ben drives");
  });

  it("counts the time that is left", () => {
    expect(live().querySelector("[data-left]").textContent).toBe("1:05");
    vi.advanceTimersByTime(3000);
    expect(live().querySelector("[data-left]").textContent).toBe("1:02");
  });

  it("takes no press on a button that has just moved under the finger", async () => {
    answers = [answer(pageOf(turn(2, "Ben")))];
    made[0].says(JSON.stringify({ t: "bookings_changed", turns: true }));
    await vi.advanceTimersByTimeAsync(10);
    live().querySelector("[name=action]").click();
    expect(fetch).toHaveBeenCalledTimes(1);
    await vi.advanceTimersByTimeAsync(600);
    answers = [answer(pageOf(""))];
    live().querySelector("[name=action]").click();
    expect(fetch).toHaveBeenCalledTimes(2);
    expect(fetch.mock.lastCall[0]).toBe("/l/"); // not the button, which has the name "action"
  });

  it("says that the server does not answer", async () => {
    await changed();
    expect(document.querySelector("[data-part=news]").hidden).toBe(false);
    expect(live().textContent).toContain("Ada");
  });

  it("offers the robot's motions beside those that are chosen, when they are looked at", async () => {
    page.close();
    document.body.innerHTML += `<details><div data-part="motions" data-motions="/m/">
      <div data-part="motion-ticks"><label><input name="motions" value="wave" checked></label></div>
      <p data-part="motions-none"></p></div></details>`;
    page = new LessonPage(document.body, "/l/");
    expect(fetch).not.toHaveBeenCalled();
    const json = async () => ({ motions: [{ name: "wave" }, { name: "bow", title: "Bow" }] });
    answers = [{ ok: true, json }];
    document.querySelector("details").dispatchEvent(new Event("toggle"));
    await vi.advanceTimersByTimeAsync(1);
    const boxes = [...document.querySelectorAll("[name=motions]")];
    expect(boxes.map(({ value, checked }) => [value, checked])).toEqual([
      ["wave", true],
      ["bow", false],
    ]);
    expect(document.querySelector("[data-part=motions-none]").hidden).toBe(true);
  });
});
