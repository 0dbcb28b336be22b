/** Tasks for the robot except driving: each has a number, one answer, and one notice. */

import { takeControlFirst } from "../control/lease.js";
import { isolated } from "../lib/languages.js";
import { limbName } from "../limbs/words.js";
import { useLabel } from "./uses.js";

export const PATIENCE_MS = 750;
// After this time an answer is ignored: the person does not expect it any more.
export const FORGOTTEN_MS = 15_000;

// Requests that need no control: the console checks who may cancel.
const WITHOUT_CONTROL = new Set(["refresh", "play_cancel", "say_cancel"]);

/** The name of a request, in words. */
function requestText(request) {
  switch (request.t) {
    case "look_ahead":
      return gettext("Look ahead");
    case "turn_head":
      return gettext("Turn the head");
    case "forget":
      return gettext("Forget what was seen");
    case "play":
      return interpolate(gettext("Play %s"), [request.title ?? request.motion]);
    case "play_cancel":
      return gettext("Cancel the motion");
    case "say":
      return interpolate(gettext("Say “%s”"), [isolated(shortened(request.text))]);
    case "say_cancel":
      return gettext("Cancel speech");
    case "drive_by_cancel":
      return gettext("Cancel the drive");
    case "go":
      return gettext("Go there");
    case "go_cancel":
      return gettext("Cancel the drive to a place");
    case "set_pose":
      return gettext("Robot is here");
    case "move_limb":
      return limbName(request.limb);
    case "limb_cancel":
      return gettext("Cancel the move of gripper or torso");
    case "choose":
      return interpolate(gettext("Change where %s goes"), [useLabel(request.use)]);
    case "publish":
      return interpolate(gettext("Publish on %s"), [request.topic]);
    case "publish_stop":
      return interpolate(gettext("Stop publishing on %s"), [request.topic]);
    case "refresh":
      return gettext("Read the list again");
    default:
      return request.t;
  }
}

/** Text for an accepted request; empty if the robot reports its end later. */
function doneText(request) {
  switch (request.t) {
    case "look_ahead":
      return gettext("The head turns to where the robot drives.");
    case "set_pose":
      return gettext("The robot was told where it is.");
    case "forget":
      return gettext("Remembered obstacles are forgotten.");
    case "choose":
      return interpolate(
        request.topic
          ? gettext("%(use)s goes to %(topic)s now.")
          : gettext("%(use)s goes to its default again."),
        { use: useLabel(request.use), topic: request.topic },
        true,
      );
    case "publish":
      return interpolate(gettext("Published on %s."), [request.topic]);
    case "publish_stop":
      return publishedNoMore(request.topic);
    case "refresh":
      return gettext("The robot is asked for its list again.");
    default:
      return "";
  }
}

/** Text for the end of publishing on a topic. */
export function publishedNoMore(topic) {
  return interpolate(gettext("Publishing on %s has ended."), [topic]);
}

/** The beginning of a text, on one line. */
export function shortened(text, length = 40) {
  const line = text.replace(/\s+/g, " ").trim();
  const letters = Array.from(line);
  return letters.length <= length ? line : `${letters.slice(0, length - 1).join("")}…`;
}

/**
 * Sends requests with the fence of this tab's control, matches answers to requests by their number, and shows
 * notices about them.
 */
export class TaskRequests {
  #send;
  #notify;
  #seq;
  #fence = null;
  #waiting = new Map();

  /**
   * @param {(message: object) => boolean} send returns whether there was a connection
   * @param {(notice: {level: string, code: string, text: string}) => void} notify
   * @param {number} first the last used number: a reload of the tab does not set it back
   */
  constructor(send, notify, first) {
    this.#send = send;
    this.#notify = notify;
    this.#seq = first;
  }

  /** @param {?number} fence of this tab's control; null: it has none */
  set fence(fence) {
    this.#fence = fence;
  }

  /**
   * @param {object} request without its number and fence. `title` is for people and is not sent; `quiet`:
   *   only refusals are reported, for requests that a page repeats.
   * @returns {Promise<?object>} the refusal; null if it was accepted
   */
  send(request) {
    if (this.#fence === null && !WITHOUT_CONTROL.has(request.t)) {
      const text = takeControlFirst();
      return Promise.resolve(this.#refused(request, { code: "no_lease", text }));
    }
    const { title, quiet, ...message } = request;
    this.#seq += 1;
    message.seq = this.#seq;
    if (this.#fence !== null && request.t !== "refresh") message.fence = this.#fence;
    if (!this.#send(message)) {
      const text = gettext("There is no connection to the console: nothing was sent.");
      return Promise.resolve(this.#refused(request, { code: "not_connected", text }));
    }
    return new Promise((resolve) => {
      const late = setTimeout(() => this.#late(message.seq), PATIENCE_MS);
      const forgotten = setTimeout(() => this.#waiting.delete(message.seq), FORGOTTEN_MS);
      this.#waiting.set(message.seq, { request, resolve, timers: [late, forgotten] });
    });
  }

  /** @returns {boolean} whether the message was the answer to a request */
  receive({ t, of, seq, refusal }) {
    const waiting = this.#waiting.get(seq);
    if ((t !== "accepted" && t !== "refused") || waiting?.request.t !== of) return false;
    this.#forget(seq);
    waiting.resolve(
      t === "accepted" ? this.#done(waiting.request) : this.#refused(waiting.request, refusal),
    );
    return true;
  }

  /** The connection is lost: no answers will come. */
  lost() {
    const text = gettext("The connection was lost before an answer came.");
    for (const [seq, { request, resolve, isLate }] of this.#waiting) {
      this.#forget(seq);
      if (!isLate) resolve(this.#refused(request, { code: "no_answer", text }));
    }
  }

  close() {
    for (const seq of this.#waiting.keys()) this.#forget(seq);
  }

  #forget(seq) {
    for (const timer of this.#waiting.get(seq).timers) clearTimeout(timer);
    this.#waiting.delete(seq);
  }

  #done(request) {
    const text = doneText(request);
    if (text && !request.quiet) this.#notify({ level: "success", code: text, text });
    return null;
  }

  #refused(request, refusal) {
    const what = requestText(request); // two refused motions are two notices, also if the reason is the same
    const code = `${what} ${refusal.code}`;
    this.#notify({ level: "warning", code, text: `${what}: ${refusal.text}` });
    return refusal;
  }

  #late(seq) {
    const waiting = this.#waiting.get(seq);
    waiting.isLate = true; // reported as late here: it is reported again only if its answer comes
    const text = gettext("no answer within 0.75 s. Look what the robot does before you try again.");
    waiting.resolve(this.#refused(waiting.request, { code: "no_answer", text }));
  }
}
