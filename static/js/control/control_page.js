/** The control page: wires the modules together. One `ControlPage` per page; `close()` ends all of it. */

import { Heartbeat } from "../connection/heartbeat.js";
import { DelayEchoes, RoundTrips } from "../connection/round_trips.js";
import { CLOSED_FOR_GOOD, LiveSocket, socketUrl } from "../connection/socket.js";
import { DriveSender } from "../drive/drive_sender.js";
import { DrivingOptions } from "../drive/driving_options.js";
import { listenToGamepads } from "../drive/input/gamepad.js";
import { Joystick } from "../drive/input/joystick.js";
import { listenToKeys } from "../drive/input/keyboard.js";
import { keysHelp } from "../drive/input/keys_help.js";
import { isNeutral, Stick } from "../drive/input/stick.js";
import { TurnAndLook } from "../drive/input/turn.js";
import { screenLock } from "../drive/wake_lock.js";
import { hand, isDialogOpen } from "../hand/watch.js";
import { barredText, lostText, soonText } from "../hand/words.js";
import { mark, parts } from "../lib/dom.js";
import { question } from "../lib/question.js";
import { tabClock, tabToken } from "../lib/tab.js";
import { Tabs } from "../lib/tabs.js";
import { newsAsNotices } from "../page/news_feed.js";
import { Notices } from "../page/notices.js";
import { Choices } from "./choices.js";
import { ControlPanel } from "./control_panel.js";
import { ControlRequests, isControlRequest } from "./control_requests.js";
import { Hints } from "./hints.js";
import { Drawers } from "./layout/drawers.js";
import { Over } from "./layout/over.js";
import { whyNotNow } from "./lease.js";
import { PANELS } from "./panels/list.js";
import { PagePanels } from "./panels/page_panels.js";
import { PageState } from "./panels/page_state.js";
import { silenceOf } from "./reason/silence.js";
import { RobotContact } from "./robot_contact.js";
import { isAtLeast } from "./roles.js";
import { Signals } from "./signals/signals.js";
import { controlWords } from "./status/control_words.js";
import { StatusBar } from "./status/status_bar.js";
import { isHeld } from "./status/status_text.js";
import { StopButton } from "./stop/stop_button.js";

const UPDATE_MS = 100; // a stale world looks stale within half a second
const BACK_OFF_M = 0.3;
const NEUTRAL_SAID_AFTER_MS = 300; // a stick at rest is neutral again before a person could read the text

// Refusals of stick commands that get no notice: there are many of them, and the delay, the words in the
// picture or the banner show the reason.
const SHOWN_ELSEWHERE = new Set([
  "too_old",
  "out_of_order",
  "stopped",
  "neutral_needed",
  "motion_running",
  "limb_moving",
  "robot_offline",
]);

// Notices of the console that the control panel already shows: its list has the people who ask for control.
const SHOWN_BY_PANEL = new Set(["asked"]);

class ControlPage {
  #root;
  #parts;
  #tab;
  #clock = tabClock();
  #socket;
  #heartbeat;
  #greeted = false; // hello was sent on this connection
  #stick = new Stick();
  #joystick;
  #turn;
  #sender;
  #stopButton;
  #clear;
  #requests;
  #stopAsked = 0; // number of the stop that the dialog "clear" shows
  #panel;
  #options;
  #statusBar;
  #notices;
  #state = new PageState();
  #panels;
  #tabs;
  #drawers;
  #hints;
  #signals;
  #over;
  #screen = screenLock();
  #echoes = new DelayEchoes();
  #echoTrips = new RoundTrips();
  #control = null;
  #told = "null"; // the tasks of a lesson, as panels know them
  #mine = false; // this tab has control by the server's last report; also while the connection is lost
  // The connection was lost while this tab had control, and the server has not reported control since.
  #lostWithControl = false;
  #outdated = false; // the console uses another version of the protocol than this page
  #facts = null;
  #role = "observer";
  #contact = new RobotContact();
  #moved = false; // the stick is not at rest
  #isStale = false; // what the page shows of the robot is old
  #needsSign = false; // what a hand holds lets go soon, unless the hand moves
  // Since when the stick has had to return to the middle; if it need not, the present time.
  #needsNeutralSinceMs = 0;
  #timer;
  #endings = [];
  #listening = new AbortController();

  /** @param {HTMLElement} root @param {string} tab the tab's own token */
  constructor(root, tab) {
    this.#root = root;
    this.#tab = tab;
    this.#parts = parts(document);
    this.#socket = new LiveSocket(socketUrl(root.dataset.socket));
    this.#heartbeat = new Heartbeat(this.#socket);
    this.#socket.connect();
    this.#greet(); // the console answers while the page is made
    this.#joystick = new Joystick(this.#parts.zone, this.#stick);
    this.#turn = new TurnAndLook(this.#parts.turn, this.#stick, (may) =>
      this.#notify(
        "info",
        "turn",
        may ? gettext("Hold the button: the robot turns for as long as you do.") : whyNotNow(),
      ),
    );
    this.#sender = new DriveSender(this.#echoes.counted(this.#socket), this.#stick, this.#clock);
    this.#panel = new ControlPanel(this.#parts);
    this.#options = new DrivingOptions(root, this.#parts);
    this.#statusBar = new StatusBar(root, this.#parts, this.#acts(), (notice) =>
      this.#notices.add(notice),
    );
    this.#notices = new Notices(this.#parts);
    const choices = new Choices(root.dataset);
    this.#panels = new PagePanels(PANELS, this.#state, {
      root,
      parts: this.#parts,
      send: (message) => this.#socket.send(message),
      notify: (notice) => this.#report(notice),
      choices,
      clock: this.#clock,
      steers: () => this.#steers,
    });
    this.#state.subscribe(this.#options, ["facts", "tasks"]);
    this.#state.subscribe(this.#statusBar, ["facts"]);
    this.#state.subscribe(this.#turn, ["state", "mayAct"]);
    this.#tabs = new Tabs(root, this.#parts.tabs, this.#parts.panel);
    this.#drawers = new Drawers(root);
    this.#over = new Over(root);
    this.#hints = new Hints(root, this.#parts, choices);
    this.#signals = new Signals(this.#parts, choices);
    this.#requests = new ControlRequests(
      (message) => this.#socket.send(message),
      (notice) => this.#notices.add(notice),
    );
    this.#clear = question(this.#parts["clear-dialog"], () =>
      this.#requests.send({ t: "clear", number: this.#stopAsked }),
    );
    this.#stopButton = new StopButton(this.#parts.stop, {
      send: () => this.#sendStop(),
      answered: (sinceMs) => this.#contact.isStoppedSince(sinceMs),
      showText: (text) => this.#statusBar.stopSays(text),
      fail: (text) => this.#statusBar.stopFailed(text),
    });
    const { news } = root.dataset;
    if (news) this.#endings.push(newsAsNotices(news, (notice) => this.#notices.add(notice)));
    this.#listen();
    this.#tellRights();
    this.#tabs.begin();
  }

  get #drives() {
    return this.#control?.state === "yours" && this.#socket.open;
  }

  /** Whether keys drive the robot now: on tabs with the stick, also if the person's layout hides it. */
  get #steers() {
    return this.#drives && Boolean(this.#root.dataset.stick);
  }

  close() {
    this.#zero("closed");
    this.#sender.stop();
    clearInterval(this.#timer);
    this.#listening.abort();
    for (const end of this.#endings) end();
    this.#drawers.end();
    const opened = [
      this.#state,
      this.#panels,
      this.#hints,
      this.#signals,
      this.#over,
      this.#panel,
      this.#options,
      this.#statusBar,
      this.#tabs,
      this.#requests,
      this.#notices,
      this.#stopButton,
      this.#clear,
      this.#joystick,
      this.#turn,
      this.#screen,
      this.#heartbeat,
      this.#socket,
    ];
    for (const part of opened) part.close();
  }

  // --- wiring ----------------------------------------------------------------------------------

  #listen() {
    const { signal } = this.#listening;
    const on = (target, type, act) =>
      target.addEventListener(type, (event) => act(event.detail), { signal });
    on(this.#socket, "open", () => this.#opened());
    on(this.#socket, "down", ({ code }) => this.#lost(code));
    on(this.#socket, "message", (message) => this.#receive(message));
    on(this.#panel, "choose", (message) => this.#chose(message));
    on(this.#panel, "warn", (text) => this.#notify("warning", "slot", text));
    on(this.#options, "share", (share) => Object.assign(this.#sender, { share }));
    on(this.#options, "slides", (slides) => Object.assign(this.#joystick, { slides }));
    on(this.#options, "sticky", (sticky) => Object.assign(this.#joystick, { sticky }));
    on(this.#tabs, "change", ({ tab, before }) => this.#changed(tab, before));
    on(this.#stick, "change", ({ input }) => this.#stickMoved(input));
    this.#root.addEventListener("pointerdown", (event) => this.#touched(event), { signal });
    on(document, "visibilitychange", () => this.#contact.hide(performance.now()));
    on(hand, "interrupted", ({ reason }) => this.#zero(reason));
    on(hand, "barred", () => this.#drives && this.#notify("info", "hand", barredText()));
    on(hand, "lost", (lost) => this.#handLost(lost));
    on(hand, "soon", (soon) => this.#handSoon(soon));

    const host = {
      stick: this.#stick,
      holonomic: () => this.#facts?.holonomic ?? false,
      drives: () => this.#steers,
      refused: () => this.#wish(),
      take: () => this.#take(),
      notify: (text) => this.#notify("info", "gamepad", text),
      mayStop: () => this.#mine,
      stop: () => this.#stopButton.press(),
    };
    const menu = document.querySelector(".menu");
    // Runs before the dialog opens: when the dialog is closed, the focus returns to the menu.
    const shut = () => {
      menu.querySelector("summary").focus();
      menu.open = false;
    };
    for (const opener of [
      this.#parts["log-open"],
      this.#parts["keys-open"],
      this.#parts["hints-open"],
      this.#parts["lichtblick-open"],
      this.#parts["record-open"],
      this.#parts["keep-this"],
    ])
      opener.addEventListener("click", shut, { signal, capture: true });
    this.#endings.push(
      listenToKeys(host),
      listenToGamepads(host),
      keysHelp(this.#parts["keys-dialog"], this.#parts["keys-open"]),
    );
    this.#timer = setInterval(() => this.#update(), UPDATE_MS);
  }

  /** Send a choice about control. A release ends driving at once, before the answer comes. */
  #chose(message) {
    if (message.t === "release") {
      this.#zero("released");
      this.#sender.stop();
    }
    this.#requests.send(message);
  }

  /** Another tab is shown: the base gets a zero, but no emergency stop. */
  #changed(tab, before) {
    if (before !== null) this.#zero("tab-changed");
    this.#drawers.close();
    if (!this.#outdated) this.#state.tell({ tab });
  }

  #stickMoved(input) {
    if (input && input !== "turn") this.#drawers.close(); // the button for "turn" is in a drawer
    const wasMoved = this.#moved;
    this.#moved = Boolean(input);
    if (input && !wasMoved) this.#wish(); // a gamepad moves the stick also without control
    if (wasMoved && !input) this.#hints.done("stick"); // it was pushed and released
  }

  // --- connection ------------------------------------------------------------------------------

  #opened() {
    this.#heartbeat.begin();
    this.#greet();
    this.#update();
  }

  /** Say hello, once on each connection. */
  #greet() {
    this.#greeted ||= this.#socket.send({ t: "hello", tab: this.#tab });
  }

  #lost(code) {
    this.#greeted = false;
    this.#lostWithControl ||= this.#control?.state === "yours";
    this.#control = null;
    this.#panel.control = null;
    this.#panels.lost();
    this.#requests.lost();
    this.#follow();
    this.#update();
    // The reloaded page gives the reason, or is the sign-in page.
    if (CLOSED_FOR_GOOD.has(code)) location.reload();
  }

  /** Which part of the way to the robot is silent, and for how long; null: none. */
  get #silence() {
    return silenceOf({
      connected: this.#socket.open,
      ...this.#contact.facts(performance.now()),
      delayMs: this.#heartbeat.delayMs,
    });
  }

  #receive(message) {
    this.#heartbeat.receive(message);
    if (this.#panels.receive(message)) return;
    switch (message.t) {
      case "view":
        return this.#onView(message);
      case "control":
        return this.#onControl(message);
      case "welcome":
        return this.#onWelcome(message);
      case "notice":
        return this.#notices.add({ ...message, quiet: SHOWN_BY_PANEL.has(message.code) });
      case "refused":
        return this.#onRefused(message);
      case "bridge_gone":
        this.#contact.lose(message);
        this.#panels.gone();
        return this.#update();
      default: // for panels alone
        return this.#state.tell({ [message.t]: message });
    }
  }

  #onWelcome(welcome) {
    if (welcome.protocol !== Number(this.#root.dataset.protocol)) return this.#outdate();
    const { robot, role } = welcome;
    if (role !== "observer") this.#hints.begin();
    this.#facts = robot;
    this.#role = role;
    this.#state.tell({ facts: robot, role });
    this.#tellRights();
  }

  /** After an upgrade of the console, a page that was open before sends only stops, to the form's URL. */
  #outdate() {
    this.#outdated = true;
    this.#state.tell({ tab: null });
    this.#socket.close();
  }

  #onControl(control) {
    const { fence = null, asking = null } = this.#control ?? {};
    this.#control = control;
    this.#tellTasks(control.tasks ?? null);
    this.#mine = control.state === "yours";
    this.#panel.control = control;
    const begins = this.#mine && control.fence !== fence;
    if (begins) {
      this.#statusBar.granted();
      this.#stick.neutralise("control-began");
      this.#hints.done("take");
    }
    // The person waited in line and did not take control just now: control was handed over.
    if (!this.#requests.receive(control) && begins && asking)
      this.#notify("success", "control", gettext("Control was handed to you."));
    // After a reconnect the server may report our own old connection as "away" or "elsewhere": wait.
    if (this.#lostWithControl && ["free", "other"].includes(control.state))
      this.#notify("warning", "left", gettext("Control ended while the connection was lost."));
    this.#lostWithControl &&= ["away", "elsewhere"].includes(control.state);
    this.#follow();
    this.#update();
  }

  /** The tasks that the present lesson leaves to this person; null: everything. */
  #tellTasks(tasks) {
    const told = JSON.stringify(tasks);
    if (told === this.#told) return;
    this.#told = told;
    this.#state.tell({ tasks });
  }

  /** Enable driving while this tab has control, and only then. */
  #follow() {
    const drives = this.#drives;
    if (drives) {
      this.#sender.start(this.#control.fence);
    } else {
      this.#stick.neutralise("control-ended");
      this.#sender.stop();
    }
    this.#tellRights();
    this.#screen.keep(drives);
    mark(this.#root, "drives", drives);
  }

  #tellRights() {
    const drives = this.#drives;
    const fence = drives ? this.#control.fence : null;
    // null until the server has reported control
    const mayAct = this.#control === null ? null : drives && !this.#isStale;
    this.#state.tell({ fence, mayAct, mayCancel: drives || isAtLeast(this.#role, "supervisor") });
  }

  /** Without control the joystick takes no pointer: notice a press at its place. */
  #touched({ clientX: x, clientY: y, target }) {
    if (this.#drives || target.closest("button, a, [popover], dialog")) return;
    const { left, right, top, bottom } = this.#parts.zone.getBoundingClientRect();
    if (x >= left && x <= right && y >= top && y <= bottom) this.#wish();
  }

  /** The key for control was pressed: press the button, or say why there is none. */
  #take() {
    const button = this.#parts.actions.querySelector("[data-action=take]");
    if (button.hidden || isDialogOpen()) this.#wish();
    else button.click();
  }

  /** The person wants to drive, and this tab has no control. */
  #wish() {
    if (this.#control === null || this.#drives) return;
    if (isDialogOpen()) return this.#notify("info", "hand", barredText());
    const { headline, reason, actions } = controlWords(this.#control);
    const [act] = actions.filter((name) => name === "take" || name === "ask");
    this.#statusBar.wished({
      level: "warning",
      title: act === "take" ? gettext("Take control first: then you drive") : headline,
      text: reason,
      act,
    });
    this.#update();
  }

  /** Acts of the button beside the reason, by name. */
  #acts() {
    const { actions, forget, "arm-home": home } = this.#parts;
    const press = (name) => actions.querySelector(`[data-action=${name}]`).click();
    const ask = (request) => this.#panels.request(request);
    const atRest = (act) => () => {
      this.#zero("asked"); // while the stick is pushed, the robot begins no task
      act();
    };
    return {
      clear: () => {
        this.#stopAsked = this.#contact.state?.stop.number ?? 0;
        this.#clear.ask();
      },
      take: () => press("take"),
      ask: () => press("ask"),
      back_off: atRest(() => ask({ t: "drive_by", distance_m: -BACK_OFF_M })),
      turn: atRest(() => ask({ t: "drive_by", angle_rad: Math.PI })),
      look: () => ask({ t: "look_ahead" }),
      forget: () => forget.click(),
      arm_home: atRest(() => home.click()),
    };
  }

  /** Take a panel's notice. The reason for the end of a task stays where people look for reasons. */
  #report(notice) {
    if (notice.stays) this.#statusBar.ended(notice);
    this.#notices.add(notice);
  }

  #onRefused({ of, refusal }) {
    // While the stick is at rest, the person requested nothing: no notice.
    if (of === "drive" && (SHOWN_ELSEWHERE.has(refusal.code) || isNeutral(this.#stick.axes)))
      return;
    if (isControlRequest(of)) return this.#requests.refused(of, refusal);
    if (of === "stop") this.#stopButton.refused(refusal.text);
    else this.#notify("warning", `${of} ${refusal.code}`, refusal.text);
  }

  // --- the robot -------------------------------------------------------------------------------

  #onView(view) {
    // This comes first: an error in the code below must not end the views.
    requestAnimationFrame(() => this.#socket.send({ t: "ack" }));
    const before = this.#contact.state;
    const now = performance.now();
    this.#contact.receive(view.state, now);
    const echo = this.#echoes.receive(view.state.seq, now);
    if (echo !== null) this.#echoTrips.add(echo);
    this.#state.tellView(view);
    this.#followGate(view.state, before);
    this.#update();
  }

  /** Release the stick at every stop; also a stick held without a finger, when the gate allows no motion. */
  #followGate({ stop, verdict }, before) {
    if (stop.state === "clear") this.#requests.done("clear");
    if (stop.state !== "clear" && before?.stop.state === "clear") this.#stick.neutralise("stopped");
    if (this.#joystick.sticks && isHeld(verdict)) this.#stick.neutralise("held");
  }

  /** Send a stop over the socket. Return true only if an answer can be expected there. */
  #sendStop() {
    this.#hints.done("stop");
    this.#zero("stop");
    const isHeard = [undefined, "robot"].includes(this.#silence?.who);
    return this.#socket.send({ t: "stop" }) && isHeard;
  }

  /** Let the base stand: set the stick to neutral, and stop repeating velocities. */
  #zero(reason) {
    this.#stick.neutralise(reason);
    this.#sender.zero();
    this.#panels.zero();
  }

  // --- what is shown ---------------------------------------------------------------------------

  #update() {
    const now = performance.now();
    if (document.hidden) this.#contact.hide(now);
    const asksNeutral = this.#stick.waitsForNeutral || Boolean(this.#contact.state?.neutral_needed);
    if (!asksNeutral || !this.#drives) this.#needsNeutralSinceMs = now;
    const silence = this.#silence;
    if (Boolean(silence) !== this.#isStale) {
      this.#isStale = Boolean(silence);
      mark(document.body, "stale", this.#isStale);
      this.#state.tell({ stale: this.#isStale });
      this.#tellRights();
    }
    this.#panel.silent = silence?.who ?? "";
    mark(this.#root, "cut", !this.#socket.open || this.#contact.isLost(now));
    const reason = this.#statusBar.show({
      outdated: this.#outdated,
      connected: this.#socket.open,
      ...this.#contact.facts(now),
      silence,
      asks: this.#needsSign ? soonText() : "",
      hint: this.#turn.holdText || this.#reverseHint(),
      mayAct: this.#drives && !this.#isStale,
      asksNeutral: now - this.#needsNeutralSinceMs > NEUTRAL_SAID_AFTER_MS,
      mayClear: Boolean(this.#control?.may_clear),
      delayMs: this.#heartbeat.delayMs,
      echoMs: this.#echoTrips.median,
    });
    const isOnlyHidden = silence?.who === "console" && this.#contact.wasHidden(now);
    const lost = isOnlyHidden ? null : silence;
    this.#signals.follow(this.#contact.state, lost, reason?.title ?? "", now);
  }

  #reverseHint() {
    if (this.#stick.axes.x >= 0) return "";
    return this.#facts?.reverse_steering === "car"
      ? gettext("Reversing: steers like a car.")
      : gettext("Reversing: stick left still turns left.");
  }

  #handLost(lost) {
    const text = lostText(lost);
    if (text) this.#notify("info", "hand", text);
  }

  #handSoon(soon) {
    this.#needsSign = soon;
    this.#update();
  }

  #notify(level, code, text) {
    this.#notices.add({ level, code, text });
  }
}

const root = document.querySelector("[data-page=control]");
if (root) {
  let page = new ControlPage(root, await tabToken());
  // A page in the back/forward cache has no connection: it is reloaded when it is shown again.
  window.addEventListener("pagehide", () => {
    page?.close();
    page = null;
  });
  window.addEventListener("pageshow", ({ persisted }) => persisted && location.reload());
}
