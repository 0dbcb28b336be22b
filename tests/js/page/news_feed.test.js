import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { followNews, showNews } from "../../../static/js/page/news.js";
import { NewsFeed, newsAsNotices } from "../../../static/js/page/news_feed.js";
import { FakeSocket, made } from "../fake_socket.js";

let hidden = false;
let end = () => {};

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal("WebSocket", FakeSocket);
  FakeSocket.begin();
  hidden = false;
  vi.spyOn(document, "hidden", "get").mockImplementation(() => hidden);
});

afterEach(() => {
  end();
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

function begin(show = () => {}) {
  const feed = new NewsFeed("/ws/news/", show);
  end = () => feed.close();
  vi.advanceTimersByTime(3000);
  made.at(-1)?.opens();
}

function turns(to) {
  hidden = to === "hidden";
  document.dispatchEvent(new Event("visibilitychange"));
}

function tells(...items) {
  made.at(-1).says(JSON.stringify({ t: "news", items }));
}

const item = (number, passing = false) => ({
  number,
  subject: `Subject ${number}`,
  text: "Text",
  path: "/robots/tiago-1/",
  passing,
});

test("a page that is not seen for a while has no connection, and one again when it is seen", () => {
  begin();
  turns("hidden");
  vi.advanceTimersByTime(20_000);
  expect(made[0].readyState).toBe(1);
  vi.advanceTimersByTime(20_000);
  expect(made[0].readyState).toBe(3);
  turns("visible");
  vi.advanceTimersByTime(1);
  expect(made.length).toBe(2);
});

test("a console that does not answer is asked ever more rarely", () => {
  begin();
  for (let i = 0; i < 600; i++) {
    if (made.at(-1).readyState !== 3) made.at(-1).close();
    vi.advanceTimersByTime(1000);
  }
  expect(made.length).toBeLessThan(25);
});

test("a connection that answers no ping is made again", () => {
  begin();
  vi.advanceTimersByTime(20_001);
  made[0].says('{"t": "pong", "sent_ms": 1}');
  vi.advanceTimersByTime(20_000);
  expect(made.length).toBe(1);
  vi.advanceTimersByTime(21_000);
  expect(made.length).toBe(2);
});

test("a page whose person signed out asks no more", () => {
  begin();
  made[0].close(4401);
  vi.advanceTimersByTime(120_000);
  expect(made.length).toBe(1);
});

const CARD =
  '<aside hidden data-news="/ws/news/"><ul></ul><button data-more aria-expanded="false" hidden></button><form><input name="next"><button name="newest"></button></form></aside>';

test("a card counts what is beside the newest, and a press shows all", () => {
  document.body.innerHTML = CARD;
  const card = document.querySelector("aside");
  const more = card.querySelector("[data-more]");
  const feed = followNews(card);
  end = () => feed.close();
  showNews(card, [item(1)]);
  expect(more.hidden).toBe(true);
  showNews(card, [item(3), item(2), item(1)]);
  expect([more.hidden, more.textContent]).toEqual([false, "2 more"]);
  more.click();
  expect(more.getAttribute("aria-expanded")).toBe("true");
  more.click();
  expect(more.getAttribute("aria-expanded")).toBe("false");
});

test("a card shows what is unseen, and nothing twice", () => {
  document.body.innerHTML = CARD;
  const card = document.querySelector("aside");
  showNews(card, [item(2), item(1)]);
  const first = card.querySelector("li");
  showNews(card, [item(2), item(1)]);
  expect(card.hidden).toBe(false);
  expect(card.querySelector("li")).toBe(first);
  expect(first.querySelector("a").getAttribute("href")).toBe("/robots/tiago-1/");
  expect(card.querySelector("[name=newest]").value).toBe("2");
  showNews(card, []);
  expect(card.hidden).toBe(true);
});

test("a driving page says what comes, and of what was there only what is about this moment", () => {
  const said = [];
  end = newsAsNotices("/ws/news/", ({ short }) => said.push(short));
  vi.advanceTimersByTime(3000);
  made[0].opens();
  tells(item(3, true), item(2));
  expect(said).toEqual(["Subject 3"]);
  tells(item(4), item(3, true), item(2));
  tells(item(4), item(2));
  expect(said).toEqual(["Subject 3", "Subject 4"]);
});
