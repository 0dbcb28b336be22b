/** All tasks except driving: motions, speech, topics, with common requests and notices. */

import { socketUrl } from "../connection/socket.js";
import { isAtLeast } from "../control/roles.js";
import { Forget } from "../drive/forget.js";
import { LookAhead } from "../drive/look_ahead_button.js";
import { TopicsTab } from "../topics/topics_tab.js";
import { History } from "./history.js";
import { endNotice, Motions } from "./motions.js";
import { Phrases } from "./phrases.js";
import { Running } from "./running.js";
import { Say, speechEndNotice } from "./say.js";
import { ChoiceEnds, Endings } from "./task_ends.js";
import { TaskRequests } from "./tasks.js";

function noVoice() {
  return gettext("This robot has no voice.");
}

export class TaskPanel {
  #requests;
  #motions;
  #say;
  #phrases;
  #history;
  #running;
  #lookAhead;
  #forget;
  #topics;
  #acting; // the parts that need control
  #motionEnds;
  #speechEnds;
  #choiceEnds;
  #uses = {};
  #chosen = {};
  #tab = null;
  #role = "observer";
  #fence; // of this tab's control; null: it has none; undefined: not known

  /**
   * @param {Record<string, HTMLElement>} parts
   * @param {object} page
   * @param {{phrases: string, speech: string, topics: string}} page.addresses of phrases and of the
   *   history of speech; of the topics' WebSocket
   * @param {(message: object) => boolean} page.send
   * @param {import("../page/notices.js").Notices} page.notices
   * @param {() => number} page.clock milliseconds; a reload of the tab does not set it back
   */
  constructor(parts, { addresses, send, notices, clock }) {
    const notify = (notice) => notices.add(notice);
    this.#requests = new TaskRequests(send, notify, Math.floor(clock()));
    const request = (message) => this.#send(message);
    this.#motions = new Motions(parts, request);
    this.#say = new Say(parts, request);
    this.#phrases = new Phrases(parts, addresses.phrases, request);
    this.#history = new History(parts, addresses.speech, request);
    this.#running = new Running(parts, request, (name) => this.#motions.titleOf(name));
    this.#lookAhead = new LookAhead(parts["look-ahead"], request);
    this.#forget = new Forget(parts.forget, parts["forget-dialog"], request);
    const url = socketUrl(addresses.topics);
    this.#topics = new TopicsTab(parts, url, { send: request, notify }, clock);
    this.#motionEnds = new Endings((ended, name) =>
      notices.add(endNotice(ended, this.#motions.titleOf(name))),
    );
    this.#choiceEnds = new ChoiceEnds((text) =>
      notices.add({ level: "warning", code: "choice ended", text }),
    );
    this.#speechEnds = new Endings((ended, text) => notices.add(speechEndNotice(ended, text)));
    this.#acting = [
      this.#motions,
      this.#say,
      this.#phrases,
      this.#history,
      this.#running,
      this.#lookAhead,
      this.#forget,
      this.#topics,
    ];
    this.#phrases.load();
    this.#enable();
  }

  /** @param {{role: string, robot: object}} welcome */
  set welcome({ role, robot }) {
    this.#role = role;
    this.#lookAhead.facts = robot;
    this.#topics.role = role;
    this.#enable();
  }

  /** @param {object} offers of the robot */
  set offers(offers) {
    this.#uses = offers.uses ?? {};
    this.#motions.offers = offers;
    this.#motions.idle = this.#uses.motions?.refusal?.text ?? "";
    const mute = this.#uses.speech ? this.#uses.speech.refusal?.text : noVoice();
    this.#say.mute = this.#phrases.mute = mute ?? "";
    this.#say.languages = offers.languages ?? [];
    this.#topics.offers = offers;
    this.#markTopic();
  }

  /** @param {object} state of the robot */
  set state(state) {
    const { motion = null, motion_ended: motionEnded = null } = state;
    const { speech = null, speech_ended: speechEnded = null, chosen = {} } = state;
    const { choice_ended: choiceEnded = {} } = state;
    this.#chosen = chosen;
    this.#motions.state = state;
    this.#running.state = state;
    this.#topics.state = state;
    this.#choiceEnds.follow(choiceEnded);
    this.#motionEnds.follow(motion?.name ?? null, motionEnded);
    this.#speechEnds.follow(speech?.text ?? null, speechEnded);
    this.#history.state = state;
    this.#markTopic();
  }

  /** @param {?number} fence of this tab's control; null: it has none; undefined: not known */
  set fence(fence) {
    this.#fence = fence;
    this.#requests.fence = fence ?? null;
    this.#enable();
  }

  /** @param {string} tab that is shown now */
  set tab(tab) {
    if (this.#tab === "topics") this.#topics.hide();
    this.#tab = this.#running.tab = tab;
    this.#motions.showAll();
    this.#phrases.showAll();
    if (tab === "topics") this.#topics.show();
    this.#history.isShown = tab === "speech";
  }

  /**
   * Send a task that belongs to no panel.
   * @returns {Promise<?object>} the refusal; null if it was accepted
   */
  request(request) {
    return this.#send(request);
  }

  /** Stop repeating velocities. */
  zero() {
    this.#topics.zero();
  }

  /** @returns {boolean} whether the message was an answer to a request */
  receive(message) {
    return this.#requests.receive(message);
  }

  /** The connection is lost. */
  lost() {
    this.#requests.lost();
    this.away();
  }

  /** The robot is out of reach. */
  away() {
    this.#motionEnds.lost();
    this.#speechEnds.lost();
  }

  close() {
    for (const part of [...this.#acting, this.#requests]) part.close();
  }

  async #send(request) {
    const undo = this.#endingsOf(request)?.begin(request.text, request.t.endsWith("_cancel"));
    const refusal = await this.#requests.send(request);
    if (refusal && refusal.code !== "no_answer") undo?.();
    return refusal;
  }

  #endingsOf({ t }) {
    if (t === "play" || t === "play_cancel") return this.#motionEnds;
    return t === "say" || t === "say_cancel" ? this.#speechEnds : null;
  }

  #enable() {
    const mayAct = this.#fence === undefined ? null : this.#fence !== null;
    const mayCancel = mayAct || isAtLeast(this.#role, "supervisor");
    this.#motions.mayCancel = this.#running.mayCancel = mayCancel;
    for (const part of this.#acting) part.mayAct = mayAct;
  }

  #markTopic() {
    this.#history.topic = this.#chosen.speech ?? this.#uses.speech?.topic ?? null;
  }
}
