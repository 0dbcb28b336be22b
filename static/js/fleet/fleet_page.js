/** The fleet page: a card per robot, live. */

import { Heartbeat } from "../connection/heartbeat.js";
import { LiveSocket, socketUrl } from "../connection/socket.js";
import { StopButton } from "../control/stop/stop_button.js";
import { StopWords } from "../control/stop/stop_words.js";
import { mark, parts, setText, show } from "../lib/dom.js";
import { matches, searches } from "../lib/list.js";
import { recallInTab, rememberInTab } from "../lib/prefs.js";
import { showRobot, showStop } from "./card.js";
import { cardOf } from "./card_words.js";
import { ClearAll } from "./clear_all.js";
import { ConsoleNews } from "./console_news.js";
import { Thumbnails } from "./thumbnails.js";

const SIGNED_OUT = 4401;
const RELOADED_FOR = "fleet-reloaded-for"; // the robots for which this tab last reloaded the page

export class FleetPage {
  #socket;
  #heartbeat;
  #cards = new Map();
  #news;
  #words;
  #receivedMs = -Infinity; // time of this connection's last report about the robots
  #thumbnails;
  #stops = [];
  #clear = null;

  constructor(root) {
    this.#socket = new LiveSocket(socketUrl(root.dataset.socket));
    this.#heartbeat = new Heartbeat(this.#socket);
    const page = parts(document);
    this.#news = new ConsoleNews(this.#socket, page.connection, (isStale) => {
      for (const { card } of this.#cards.values()) mark(card, "stale", isStale);
    });
    this.#words = new StopWords(page["stop-all-state"]);
    for (const card of root.querySelectorAll("[data-robot]")) this.#take(card);
    if (page["clear-dialog"])
      this.#clear = new ClearAll(
        page,
        (message) => this.#send(message),
        (slug) => this.#cards.get(slug)?.card.querySelector("h2").textContent ?? slug,
      );
    if (page.search) this.#search(page.search, page["search-none"]);
    this.#stops.push(
      new StopButton(page["stop-all"], {
        send: () => this.#send({ t: "stop_all" }),
        // If a robot has no link, the server's answer names the robots that it did not reach.
        answered: (sinceMs) =>
          this.#receivedMs > sinceMs &&
          Object.values(this.#news.robots).every(({ state }) => state?.stop.state !== "clear"),
        arrived: () => this.#words.showText(gettext("Stopped.")),
        showText: (text) => this.#words.showText(text),
        fail: (text, robots) => this.#failed(text, robots),
      }),
    );
    this.#socket.addEventListener("message", ({ detail }) => this.#receive(detail));
    this.#socket.addEventListener("open", () => this.#opened());
    this.#socket.addEventListener("down", ({ detail }) => this.#lost(detail.code));
    this.#socket.connect();
    this.#thumbnails = new Thumbnails(root);
  }

  close() {
    this.#thumbnails.close();
    this.#news.close();
    for (const stop of this.#stops) stop.close();
    this.#words.close();
    this.#clear?.close();
    this.#heartbeat.close();
    this.#socket.close();
  }

  /** Send a message over the socket. Return true only if an answer can be expected there. */
  #send(message) {
    return this.#socket.send(message) && this.#news.isLive;
  }

  #take(card) {
    const slug = card.dataset.robot;
    const own = parts(card);
    this.#cards.set(slug, { card, own });
    this.#stops.push(
      new StopButton(own.stop, {
        send: () => this.#send({ t: "stop", slug }),
        answered: (sinceMs) =>
          this.#receivedMs > sinceMs &&
          (this.#news.robots[slug]?.state?.stop.state ?? "clear") !== "clear",
        showText: (text) => {
          this.#stopSays(own, text);
          this.#words.forget(slug);
        },
        fail: (text, robots) => {
          this.#stopSays(own, gettext("Not confirmed"));
          this.#failed(text, robots, slug);
        },
      }),
    );
  }

  /** @param {HTMLInputElement} field @param {HTMLElement} none the text for no match */
  #search(field, none) {
    const cards = [...this.#cards.values()].map(({ card }) => card);
    const hits = () => cards.filter((card) => !card.hidden);
    const filter = () => {
      for (const card of cards)
        show(card, matches(card.querySelector("h2").textContent, field.value));
      show(none, hits().length === 0);
    };
    searches(field, filter, hits);
    filter(); // a browser may restore the typed text
    show(field, true);
  }

  /** Show the progress of a card's stop, until the robot itself reports it. */
  #stopSays(own, text) {
    setText(own["stop-state"], text);
    mark(own["stop-state"], "fresh", true);
    show(own["stop-why"], false);
  }

  /** Report a stop that did not arrive everywhere: by robot if known, otherwise in the server's words. */
  #failed(text, robots = {}, of = "") {
    const slugs = Object.keys(robots).filter((slug) => robots[slug].code && this.#cards.has(slug));
    if (slugs.length === 0) return this.#words.fail(text, of);
    this.#words.forget(of);
    for (const slug of slugs) this.#notConfirmed(slug, robots[slug].code);
  }

  #notConfirmed(slug, code) {
    const { card, own } = this.#cards.get(slug);
    this.#stopSays(own, gettext("Not confirmed"));
    this.#words.unreached(card.querySelector("h2").textContent, slug, code === "pending");
  }

  /** Show a refusal for the robot that the server names. */
  #refused({ code, text, figures }) {
    if (this.#cards.has(figures?.slug)) this.#notConfirmed(figures.slug, code);
    else this.#words.fail(text);
  }

  #opened() {
    this.#heartbeat.begin();
    this.#receivedMs = -Infinity;
  }

  #receive(message) {
    this.#heartbeat.receive(message);
    if (message.t === "refused" && message.of === "clear") this.#clear?.refused(message.refusal);
    else if (message.t === "refused") this.#refused(message.refusal);
    if (message.t !== "fleet") return;
    this.#receivedMs = performance.now();
    const { robots } = this.#news;
    this.#followRegistry(Object.keys(robots));
    if (this.#clear) this.#clear.robots = robots;
    for (const [slug, robot] of Object.entries(message.robots)) this.#show(slug, robot);
    requestAnimationFrame(() => this.#socket.send({ t: "ack" }));
  }

  /** Reload the page when robots were added or removed; only once if the next page still has other robots. */
  #followRegistry(slugs) {
    const listed = slugs.sort().join();
    if (listed === [...this.#cards.keys()].sort().join()) {
      rememberInTab(RELOADED_FOR, null);
    } else if (recallInTab(RELOADED_FOR) !== listed) {
      rememberInTab(RELOADED_FOR, listed);
      location.reload();
    }
  }

  #show(slug, robot) {
    const held = this.#cards.get(slug);
    if (!held) return;
    const shown = cardOf(robot);
    if (shown.stopped) this.#words.delivered(slug);
    showRobot(held, shown, robot);
    // If no state came since the press, the text about the press stays.
    const silent = !robot.state && !robot.pending && held.own["stop-state"].dataset.fresh;
    if (!silent) showStop(held, shown);
  }

  #lost(code) {
    if (code === SIGNED_OUT) location.reload(); // signed out: the server shows the sign-in page
  }
}

const root = document.querySelector("[data-page=fleet]");
if (root) {
  let page = new FleetPage(root);
  window.addEventListener("pagehide", () => {
    page?.close();
    page = null;
  });
  window.addEventListener("pageshow", ({ persisted }) => persisted && location.reload());
}
