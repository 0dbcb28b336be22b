/** The lab's monitor: a card per robot, large and live, without buttons. The page needs no person. */

import { Heartbeat } from "../connection/heartbeat.js";
import { LiveSocket, socketUrl } from "../connection/socket.js";
import { screenLock } from "../drive/wake_lock.js";
import { timeText } from "../formats/times.js";
import { mark, parts, setText } from "../lib/dom.js";
import { showRobot, showStop } from "./card.js";
import { cardOf } from "./card_words.js";
import { ConsoleNews } from "./console_news.js";
import { Thumbnails } from "./thumbnails.js";

const UPDATE_MS = 500;
const SIGNED_OUT = 4401;
// The page reloads once an hour: to get the newest version, and because a sign-in ends after twelve hours
// without a request for a page.
const FRESH_MS = 60 * 60 * 1000;

export class WallPage {
  #root;
  #socket;
  #heartbeat;
  #parts;
  #cards = new Map();
  #news;
  #openedMs = performance.now();
  #screen = screenLock();
  #timer;
  #thumbnails;

  /** @param {HTMLElement} root data-stays: this account only watches, so its sign-in may last */
  constructor(root) {
    this.#root = root;
    this.#socket = new LiveSocket(socketUrl(root.dataset.socket));
    this.#heartbeat = new Heartbeat(this.#socket);
    this.#parts = parts(document);
    for (const card of root.querySelectorAll("[data-robot]"))
      this.#cards.set(card.dataset.robot, { card, own: parts(card) });
    this.#socket.addEventListener("message", ({ detail }) => this.#receive(detail));
    this.#socket.addEventListener("open", () => this.#heartbeat.begin());
    this.#socket.addEventListener("down", ({ detail }) => {
      if (detail.code === SIGNED_OUT) location.reload(); // the server shows the sign-in page
    });
    this.#screen.keep(true);
    this.#news = new ConsoleNews(this.#socket, this.#parts.connection, (isStale) => {
      for (const { card } of this.#cards.values()) mark(card, "stale", isStale);
    });
    this.#timer = setInterval(() => this.#update(), UPDATE_MS);
    this.#update();
    this.#socket.connect();
    this.#thumbnails = new Thumbnails(root);
  }

  close() {
    this.#thumbnails.close();
    clearInterval(this.#timer);
    this.#news.close();
    this.#screen.close();
    this.#heartbeat.close();
    this.#socket.close();
  }

  #receive(message) {
    this.#heartbeat.receive(message);
    if (message.t !== "fleet") return;
    for (const [slug, robot] of Object.entries(message.robots)) this.#show(slug, robot);
    requestAnimationFrame(() => this.#socket.send({ t: "ack" }));
  }

  #show(slug, robot) {
    const held = this.#cards.get(slug);
    if (!held) return; // a new robot: it appears when the page is loaded again
    const shown = cardOf(robot);
    showRobot(held, shown, robot);
    showStop(held, shown);
  }

  #update() {
    setText(this.#parts.clock, timeText(new Date()));
    const isOld = performance.now() - this.#openedMs > FRESH_MS;
    if (isOld && this.#news.isLive && "stays" in this.#root.dataset) location.reload();
  }
}

const root = document.querySelector("[data-page=wall]");
if (root) {
  const page = new WallPage(root);
  window.addEventListener("pagehide", () => page.close());
  window.addEventListener("pageshow", ({ persisted }) => persisted && location.reload());
}
