/** The fleet page: a card per robot, live. */

import { mark, parts, say, show } from "./dom.js";
import { LiveSocket, socketUrl } from "./socket.js";
import { phaseTitle, standstillText, verdictText } from "./standing.js";
import { StopButton } from "./stop.js";

const STALE_MS = 3000;
const SIGNED_OUT = 4401;

/** What a card says of one robot. Pure. */
export function cardOf({ state, refusal }) {
  if (!state)
    return {
      level: "fail",
      status: gettext("No link"),
      why: refusal?.text ?? "",
      driver: "",
      gate: "",
      stop: "",
    };
  const online = state.phase === "online";
  const { stop } = state;
  return {
    level: refusal ? "fail" : online ? "ok" : "warn",
    status: refusal ? gettext("No link") : phaseTitle(state.phase),
    why: refusal?.text ?? (online ? "" : state.text),
    driver: state.holder ?? gettext("Nobody"),
    battery:
      state.battery_percent === null
        ? "–"
        : `${Math.round(state.battery_percent)} %${state.charging ? gettext(", charging") : ""}`,
    gate: verdictText(state.verdict) || gettext("Free"),
    stop: stopWord(stop.state),
    stopped: stop.state !== "clear",
    stopWhy:
      stop.state === "clear"
        ? ""
        : [stop.by && interpolate(gettext("by %s"), [stop.by]), standstillText(stop)]
            .filter(Boolean)
            .join(". "),
  };
}

function stopWord(state) {
  if (state === "clear") return gettext("Clear");
  return state === "stopping" ? gettext("Stopping") : gettext("Stopped");
}

function connectionText(live, open) {
  if (live) return gettext("Live");
  return open ? gettext("No news") : gettext("Offline");
}

class FleetPage {
  #socket;
  #cards = new Map();
  #connection;
  #stopAllState;
  #heardMs = performance.now();
  #robots = {};
  #slugs = null; // as first heard
  #timer;
  #stops = [];

  constructor(root) {
    this.#socket = new LiveSocket(socketUrl(root.dataset.socket));
    const page = parts(document);
    this.#connection = page.connection;
    this.#stopAllState = page["stop-all-state"];
    for (const card of root.querySelectorAll("[data-robot]")) this.#take(card);
    this.#stops.push(
      new StopButton(page["stop-all"], {
        send: () => this.#socket.send({ t: "stop_all" }),
        answered: () =>
          Object.values(this.#robots).every(({ state }) => state?.stop.state !== "clear"),
        say: (text) => say(this.#stopAllState, text),
        fail: (text) => say(this.#stopAllState, text),
      }),
    );
    this.#socket.addEventListener("message", ({ detail }) => this.#heard(detail));
    this.#socket.addEventListener("open", () => this.#look());
    this.#socket.addEventListener("down", ({ detail }) => this.#lost(detail.code));
    this.#timer = setInterval(() => this.#look(), 500);
    this.#socket.connect();
  }

  close() {
    clearInterval(this.#timer);
    for (const stop of this.#stops) stop.close();
    this.#socket.close();
  }

  #take(card) {
    const slug = card.dataset.robot;
    const own = parts(card);
    this.#cards.set(slug, { card, own });
    this.#stops.push(
      new StopButton(own.stop, {
        send: () => this.#socket.send({ t: "stop", slug }),
        answered: () => (this.#robots[slug]?.state?.stop.state ?? "clear") !== "clear",
        say: (text) => say(own["stop-state"], text),
        fail: (text) => say(this.#stopAllState, text),
      }),
    );
  }

  #heard(message) {
    if (message.t === "refused") say(this.#stopAllState, message.refusal.text);
    if (message.t !== "fleet") return;
    this.#heardMs = performance.now();
    this.#followRegistry(Object.keys(message.robots).sort().join());
    this.#robots = message.robots;
    for (const [slug, robot] of Object.entries(message.robots)) this.#show(slug, robot);
    this.#look();
    requestAnimationFrame(() => this.#socket.send({ t: "ack" }));
  }

  /** Robots that come and go while the page is open bring the page anew. */
  #followRegistry(slugs) {
    this.#slugs ??= slugs;
    if (slugs !== this.#slugs) location.reload();
  }

  #show(slug, robot) {
    const held = this.#cards.get(slug);
    if (!held) return;
    const { card, own } = held;
    const shown = cardOf(robot);
    mark(card, "level", shown.level);
    mark(card, "stopped", shown.stopped);
    mark(own.status, "level", shown.level);
    say(own.status, shown.status);
    say(own.why, shown.why);
    show(own.why, shown.why !== "");
    say(own.battery, shown.battery ?? "–");
    say(own.driver, shown.driver || "–");
    say(own.gate, shown.gate || "–");
    say(own["stop-state"], shown.stop || "–");
    say(own["stop-why"], shown.stopWhy ?? "");
    show(own["stop-why"], Boolean(shown.stopWhy));
  }

  #lost(code) {
    if (code === SIGNED_OUT) location.reload(); // signed out: the server leads to the sign-in page
    this.#look();
  }

  #look() {
    const live = this.#socket.open && performance.now() - this.#heardMs < STALE_MS;
    mark(this.#connection, "level", live ? "ok" : "fail");
    say(this.#connection, connectionText(live, this.#socket.open));
    for (const { card } of this.#cards.values()) mark(card, "stale", !live);
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
