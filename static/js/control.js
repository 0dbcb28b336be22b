/** The control page: wires the modules together. One `ControlPage` per page; `close()` ends all of it. */

import { Announcer } from "./announce.js";
import { SpeedChart } from "./chart.js";
import { Choices } from "./choices.js";
import { ControlPanel } from "./control_panel.js";
import { Echoes, RoundTrips } from "./delay.js";
import { Details, fill } from "./details.js";
import { mark, parts, say, show } from "./dom.js";
import { listenToGamepad } from "./gamepad.js";
import { Joystick } from "./joystick.js";
import { listenToKeys } from "./keyboard.js";
import { Notices } from "./notices.js";
import { Picture } from "./picture.js";
import { question } from "./question.js";
import { DriveSender } from "./sender.js";
import { LiveSocket, socketUrl } from "./socket.js";
import { banner, isHeld, isStale, limitsOf, standstillText, verdictText } from "./standing.js";
import { Stick } from "./stick.js";
import { StopButton } from "./stop.js";
import { tabClock, tabToken } from "./tab.js";
import { screenLock } from "./wake.js";

const PING_MS = 1000;
const SILENCE_MS = 4000; // without any answer the connection is given up and made anew
const LOOK_MS = 250;
const STOP_SAID_MS = 3000;
const NEUTRAL_SAID_AFTER_MS = 300; // a stick that rests is neutral before anybody could read it

// Refused commands of the stick that the delay or the banner speak of; they come by the dozen.
const SHOWN_ELSEWHERE = new Set([
  "too_old",
  "out_of_order",
  "stopped",
  "neutral_needed",
  "robot_offline",
]);

class ControlPage {
  #root;
  #parts;
  #tab;
  #clock = tabClock();
  #socket;
  #stick = new Stick();
  #joystick;
  #sender;
  #clear;
  #stopButton;
  #panel;
  #choices;
  #picture;
  #chart;
  #details;
  #notices;
  #announcer;
  #screen = screenLock();
  #pings = new RoundTrips();
  #echoes = new Echoes();
  #echoTrips = new RoundTrips();
  #control = null;
  #facts = null;
  #state = null;
  #gone = null;
  #viewMs = -Infinity;
  #unansweredMs = null; // since when a ping waits for any word
  #stopSaid = { text: "", untilMs: 0 };
  #freeMs = 0; // when the stick was last not asked to return to the middle
  #timers = [];
  #endings = [];
  #listening = new AbortController();

  /** @param {HTMLElement} root @param {string} tab the tab's own token */
  constructor(root, tab) {
    this.#root = root;
    this.#tab = tab;
    this.#parts = parts(document);
    this.#socket = new LiveSocket(socketUrl(root.dataset.socket));
    this.#joystick = new Joystick(this.#parts.zone, this.#stick);
    this.#sender = new DriveSender(this.#countedSocket(), this.#stick, this.#clock);
    this.#panel = new ControlPanel(this.#parts);
    this.#choices = new Choices(root, this.#parts);
    this.#picture = new Picture(this.#parts.picture);
    this.#chart = new SpeedChart(this.#parts.chart);
    this.#details = new Details(this.#parts);
    this.#notices = new Notices(this.#parts.notices);
    this.#announcer = new Announcer(this.#parts.live);
    this.#clear = question(this.#parts["clear-dialog"], () => this.#socket.send({ t: "clear" }));
    this.#stopButton = new StopButton(this.#parts.stop, {
      send: () => this.#sendStop(),
      answered: () => !this.#isCut() && this.#state !== null && this.#state.stop.state !== "clear",
      say: (text) => this.#stopSays(text),
      fail: (text) => {
        this.#stopSays("Not confirmed");
        this.#notices.add({ level: "error", code: "stop", text });
      },
    });
    this.#listen();
    this.#socket.connect();
  }

  get #drives() {
    return this.#control?.state === "yours" && this.#socket.open;
  }

  close() {
    this.#zero("closed");
    for (const timer of this.#timers) clearInterval(timer);
    for (const end of this.#endings) end();
    this.#listening.abort();
    for (const part of [
      this.#panel,
      this.#choices,
      this.#picture,
      this.#chart,
      this.#notices,
      this.#announcer,
    ])
      part.close();
    this.#sender.stop();
    this.#stopButton.close();
    this.#clear.close();
    this.#joystick.close();
    this.#screen.close();
    this.#socket.close();
  }

  // --- wiring ----------------------------------------------------------------------------------

  #listen() {
    const { signal } = this.#listening;
    const on = (target, type, act) =>
      target.addEventListener(type, (event) => act(event.detail), { signal });
    on(this.#socket, "open", () => this.#opened());
    on(this.#socket, "down", ({ code }) => this.#lost(code));
    on(this.#socket, "message", (message) => this.#heard(message));
    on(this.#panel, "choose", (message) => this.#socket.send(message));
    on(this.#choices, "share", (share) => {
      this.#sender.share = share;
    });
    on(this.#choices, "slides", (slides) => {
      this.#joystick.slides = slides;
    });
    on(this.#choices, "sticky", (sticky) => {
      this.#joystick.sticky = sticky;
    });
    on(this.#joystick, "released", ({ reason }) => this.#stickReleased(reason));
    on(this.#stick, "change", ({ axes }) => this.#explainReverse(axes));
    on(this.#parts.clear, "click", () => this.#clear.ask());
    on(document, "visibilitychange", () => document.hidden && this.#zero("hidden"));
    on(window, "blur", () => this.#zero("blurred"));
    on(window, "pagehide", () => this.#zero("closed"));

    const host = {
      stick: this.#stick,
      holonomic: () => this.#facts?.holonomic ?? false,
      holds: () => this.#drives,
      stop: () => this.#stopButton.press(),
    };
    this.#endings.push(listenToKeys(host), listenToGamepad(host));
    this.#timers.push(
      setInterval(() => this.#ping(), PING_MS),
      setInterval(() => this.#look(), LOOK_MS),
    );
  }

  /** The socket, with every command's number remembered until the robot's bridge echoes it. */
  #countedSocket() {
    const socket = this.#socket;
    const echoes = this.#echoes;
    return {
      send(message) {
        echoes.sent(message.seq, performance.now());
        return socket.send(message);
      },
      get backlog() {
        return socket.backlog;
      },
    };
  }

  // --- connection ------------------------------------------------------------------------------

  #opened() {
    this.#unansweredMs = null;
    this.#pings.clear();
    this.#socket.send({ t: "hello", tab: this.#tab });
    this.#look();
  }

  #lost(code) {
    this.#control = null;
    this.#panel.control = null;
    this.#follow();
    this.#look();
    if (code === 4401) location.reload(); // signed out: the server leads to the sign-in page
  }

  #ping() {
    if (!this.#socket.open) return;
    const now = performance.now();
    this.#unansweredMs ??= now;
    if (now - this.#unansweredMs > SILENCE_MS) this.#socket.reset();
    else this.#socket.send({ t: "ping", sent_ms: now });
  }

  #isCut() {
    return !this.#socket.open || this.#gone !== null || isStale(performance.now() - this.#viewMs);
  }

  #heard(message) {
    this.#unansweredMs = null;
    switch (message.t) {
      case "view":
        return this.#onView(message);
      case "control":
        return this.#onControl(message);
      case "welcome":
        return this.#onWelcome(message);
      case "notice":
        return this.#notices.add(message);
      case "refused":
        return this.#onRefused(message);
      case "bridge_gone":
        this.#gone = message.refusal;
        return this.#look();
      case "pong":
        return this.#pings.add(performance.now() - message.sent_ms);
    }
  }

  #onWelcome({ robot }) {
    this.#facts = robot;
    this.#choices.facts = robot;
    this.#picture.facts = robot;
    say(this.#parts["drive-topic"], robot.drive_topic);
    say(this.#parts.profile, robot.profile);
  }

  #onControl(control) {
    const { fence: before } = this.#control ?? {};
    this.#control = control;
    this.#panel.control = control;
    if (control.state === "yours" && control.fence !== before)
      this.#stick.neutralise("control-began");
    this.#follow();
    this.#look();
  }

  /** Drives while this tab has control, and only then. */
  #follow() {
    const drives = this.#drives;
    if (drives) {
      this.#sender.start(this.#control.fence);
    } else {
      this.#stick.neutralise("control-ended");
      this.#sender.stop();
    }
    this.#screen.keep(drives);
    mark(this.#root, "drives", drives);
  }

  #onRefused({ of, refusal }) {
    if (of === "drive" && SHOWN_ELSEWHERE.has(refusal.code)) return;
    const level = of === "stop" ? "error" : "warning";
    this.#notices.add({ level, code: `${of} ${refusal.code}`, text: refusal.text });
  }

  // --- the robot -------------------------------------------------------------------------------

  #onView(view) {
    const before = this.#state;
    this.#gone = null;
    this.#state = view.state;
    this.#viewMs = performance.now();
    const echo = this.#echoes.heard(view.state.seq, this.#viewMs);
    if (echo !== null) this.#echoTrips.add(echo);
    this.#picture.view = view;
    this.#chart.add(view.state);
    this.#details.state = view.state;
    this.#followGate(view.state, before);
    this.#look();
    requestAnimationFrame(() => this.#socket.send({ t: "ack" }));
  }

  /** What ends a stick: the latch always; a full hold of the gate ends one that nobody's finger is on. */
  #followGate({ stop, verdict }, before) {
    if (stop.state !== "clear" && before?.stop.state === "clear") this.#stick.neutralise("stopped");
    if (this.#joystick.sticks && isHeld(verdict)) this.#stick.neutralise("held");
  }

  /** Over the socket; true only if an answer can be expected there. */
  #sendStop() {
    this.#zero("stop");
    return this.#socket.send({ t: "stop" }) && !this.#isCut();
  }

  #stopSays(text) {
    this.#stopSaid = { text, untilMs: performance.now() + STOP_SAID_MS };
    say(this.#parts["stop-state"], text);
  }

  #zero(reason) {
    this.#stick.neutralise(reason);
    this.#sender.zero();
  }

  // --- what is shown ---------------------------------------------------------------------------

  #look() {
    const sinceViewMs = performance.now() - this.#viewMs;
    const connected = this.#socket.open;
    const asksNeutral = this.#stick.waitsForNeutral || Boolean(this.#state?.neutral_needed);
    if (!asksNeutral || !this.#drives) this.#freeMs = performance.now();
    this.#picture.stale = this.#isCut();
    this.#showBanner(
      banner({
        connected,
        gone: this.#gone,
        state: this.#state,
        sinceViewMs,
        asksNeutral: performance.now() - this.#freeMs > NEUTRAL_SAID_AFTER_MS,
      }),
    );
    this.#showFacts(connected);
    if (this.#state) this.#showState(this.#state);
  }

  #showBanner(shown) {
    const { banner: box, "banner-title": title, "banner-text": text, clear } = this.#parts;
    show(box, shown !== null);
    if (!shown) return;
    mark(box, "level", shown.level);
    say(title, shown.title);
    say(text, shown.text);
    show(clear, Boolean(shown.clear && this.#control?.may_clear));
    this.#announcer.say(`${shown.title}. ${shown.text}`, shown.title);
  }

  #showFacts(connected) {
    const { connection, delay } = this.#parts;
    const cut = !connected || this.#gone !== null;
    mark(connection, "level", cut ? "fail" : "ok");
    say(connection, connected ? (this.#gone ? "No link" : "Connected") : "Offline");
    const trip = connected ? this.#pings.median : null;
    say(delay, trip === null ? "– ms" : `${Math.max(1, Math.round(trip))} ms`);
    const echo = this.#echoTrips.median;
    say(this.#parts.echo, echo === null ? "–" : `${Math.round(echo)} ms`);
  }

  #showState(state) {
    const { battery, words, limits, "stop-state": stopState } = this.#parts;
    show(battery, state.battery_percent !== null);
    if (state.battery_percent !== null) {
      say(battery, `${Math.round(state.battery_percent)} %${state.charging ? ", charging" : ""}`);
      mark(battery, "level", state.battery_percent < 20 ? "warn" : "ok");
    }
    mark(this.#root, "stop", state.stop.state);
    if (state.stop.state !== "clear") this.#stopSaid.untilMs = 0; // the robot itself has the word
    const said = performance.now() < this.#stopSaid.untilMs ? this.#stopSaid.text : "";
    say(stopState, stopText(state.stop) || said);
    const text = this.#isCut() ? "" : verdictText(state.verdict);
    if (text) this.#announcer.say(text, `${state.verdict.code} ${state.verdict.side}`);
    const standing = limitsOf(state.verdict);
    fill(
      limits,
      standing.map((limit) => limit.text),
    );
    for (const [i, { holds }] of standing.entries()) mark(limits.children[i], "held", holds);
    say(words, standing.some(({ holds }) => holds) ? "" : text); // once is enough
  }

  #explainReverse({ x }) {
    const text =
      this.#facts?.reverse_steering === "car"
        ? "Reversing: steers like a car."
        : "Reversing: stick left still turns left.";
    say(this.#parts.hint, x < 0 ? text : "");
  }

  #stickReleased(reason) {
    if (reason === "untouched") {
      this.#notices.add({
        level: "info",
        code: "sticky",
        text: "The stick let go: it was not touched for 30 s.",
      });
    }
  }
}

/** On the button itself: what the robot reports, in two words; empty while the latch is clear. */
function stopText(stop) {
  if (stop.state === "clear") return "";
  if (stop.state === "stopping") return "Stopping";
  return standstillText(stop) ? `Standstill after ${Math.round(stop.standstill_ms)} ms` : "Stopped";
}

const root = document.querySelector("[data-page=control]");
if (root) {
  let page = new ControlPage(root, await tabToken());
  // A page in the back/forward cache holds no connection: it is made anew when it is shown again.
  window.addEventListener("pagehide", () => {
    page?.close();
    page = null;
  });
  window.addEventListener("pageshow", ({ persisted }) => persisted && location.reload());
}
