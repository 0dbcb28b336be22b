/**
 * The notifications of this page's person, as they come. A page that is not seen has no connection, so a phone sleeps;
 * when it is seen again it gets all that is unseen.
 */

import { CLOSED_FOR_GOOD, LiveSocket, socketUrl } from "../connection/socket.js";

// A proxy ends connections that are silent for a minute. Without an answer until the next ping, the page connects again.
const PING_MS = 20_000;
const HIDDEN_MS = 30_000;
const FIRST_MS = 1000; // the page itself comes first; and a class that opens it at once comes in a row
const JITTER_MS = 2000;
const LONGEST_MS = 60_000; // between two attempts to connect

export class NewsFeed {
  #url;
  #show;
  #socket = null;
  #ping = null;
  #answers = true; // since the last ping, or the beginning
  #turn = null; // the timer of the next opening or ending
  #listening = new AbortController();

  /** @param {(items: {number, subject, text, path, passing}[]) => void} show newest first; all that are unseen */
  constructor(path, show) {
    this.#url = socketUrl(path);
    this.#show = show;
    const { signal } = this.#listening;
    // A page in the back/forward cache must have no connection
    window.addEventListener("pagehide", () => this.#end(), { signal });
    document.addEventListener("visibilitychange", () => this.#seenOrNot(), { signal });
    this.#later(FIRST_MS + JITTER_MS * Math.random(), () => this.#open());
  }

  close() {
    this.#listening.abort();
    clearTimeout(this.#turn);
    this.#end();
  }

  #seenOrNot() {
    if (document.hidden) this.#later(HIDDEN_MS, () => this.#end());
    else this.#later(0, () => this.#open());
  }

  #later(ms, act) {
    clearTimeout(this.#turn);
    this.#turn = setTimeout(act, ms);
  }

  #open() {
    if (this.#socket || document.hidden) return;
    const socket = new LiveSocket(this.#url, LONGEST_MS);
    socket.addEventListener("open", () => {
      this.#answers = true;
    });
    socket.addEventListener("message", ({ detail }) => {
      this.#answers = true;
      if (detail.t === "news") this.#show(detail.items);
    });
    socket.addEventListener("down", ({ detail }) => {
      if (CLOSED_FOR_GOOD.has(detail.code)) this.close();
    });
    this.#socket = socket;
    this.#ping = setInterval(() => this.#beat(), PING_MS);
    socket.connect();
  }

  #beat() {
    if (!this.#socket.open) return;
    if (!this.#answers) return this.#socket.reset();
    this.#answers = false;
    this.#socket.send({ t: "ping", sent_ms: performance.now() });
  }

  #end() {
    clearInterval(this.#ping);
    this.#socket?.close();
    this.#socket = null;
  }
}

/**
 * Show what comes as notices, on a page without room for a card. What was there before is shown only if it is about
 * this moment.
 * @returns {() => void} ends it
 */
export function newsAsNotices(path, add) {
  let told = null;
  const feed = new NewsFeed(path, (items) => {
    const fresh = items.filter(({ number, passing }) => (told === null ? passing : number > told));
    told = Math.max(told ?? 0, ...items.map(({ number }) => number));
    for (const { number, subject, text } of fresh.reverse())
      add({ level: "info", code: `news ${number}`, text: `${subject}\n${text}`, short: subject });
  });
  return () => feed.close();
}
