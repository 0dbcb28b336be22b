/**
 * The running drive, limb, motion and speech, on every tab, each with Cancel; and the uses of the tab that go
 * to another topic than the default.
 */

import { make, makeButton, setText, show } from "../lib/dom.js";
import { inLanguage } from "../lib/languages.js";
import { movingText } from "../limbs/words.js";
import { goingText } from "../navigation/words.js";
import { useLabel, usesOf } from "./uses.js";

/** Split a text into three: before the spoken word, the word, the rest. `word` counts code points. */
export function aroundWord(text, word) {
  if (!word) return ["", "", text];
  const letters = Array.from(text);
  const [from, to] = word;
  return [letters.slice(0, from), letters.slice(from, to), letters.slice(to)].map((part) =>
    part.join(""),
  );
}

function statusText(status) {
  const texts = {
    sent: gettext("Sent"),
    accepted: gettext("Accepted"),
    speaking: gettext("Speaking"),
  };
  return texts[status] ?? status;
}

/**
 * Return a text about a drive by a distance or an angle, with the part that is done. Robots report radians.
 */
export function driveText({
  goal_m: goalM,
  goal_rad: goalRad,
  distance_m: doneM,
  angle_rad: doneRad,
}) {
  const degrees = (radians) => Math.round((radians * 180) / Math.PI);
  return goalRad === null
    ? interpolate(gettext("Drives: %s of %s m"), [doneM.toFixed(1), goalM.toFixed(1)])
    : interpolate(gettext("Turns: %s of %s°"), [degrees(doneRad), degrees(goalRad)]);
}

export class Running {
  #parts;
  #send;
  #titleOf;
  #busy = false;
  #chosen = {}; // topics by use, where they are not the default
  #tab = null;
  #mayAct = false;
  #limbs = {};
  #listening = new AbortController();

  /**
   * @param {Record<string, HTMLElement>} parts
   * @param {(request: object) => void} send
   * @param {(motion: string) => string} titleOf returns a motion's title
   */
  constructor(parts, send, titleOf) {
    this.#parts = parts;
    this.#send = send;
    this.#titleOf = titleOf;
    const { signal } = this.#listening;
    for (const [button, t] of [
      ["drive-cancel", "drive_by_cancel"],
      ["go-cancel", "go_cancel"],
      ["motion-cancel", "play_cancel"],
      ["speech-cancel", "say_cancel"],
    ])
      parts[button].addEventListener("click", () => send({ t }), { signal });
    parts["limb-cancel"].addEventListener("click", () => this.#cancelLimbs(), { signal });
  }

  /** @param {object} state of the robot */
  set state({ drive_by: drive = null, going = null, motion = null, ...more }) {
    const { speech = null, chosen = {}, limbs = {} } = more;
    this.#limbs = limbs;
    const moves = movingText(limbs);
    show(this.#parts["limb-runs"], moves !== "");
    show(this.#parts["go-runs"], going !== null);
    show(this.#parts["drive-runs"], drive !== null);
    show(this.#parts["motion-runs"], motion !== null);
    show(this.#parts["speech-runs"], speech !== null);
    this.#busy = moves !== "" || [drive, going, motion, speech].some((task) => task !== null);
    this.#chosen = chosen;
    this.#showElsewhere();
    if (drive) {
      setText(this.#parts["drive-words"], driveText(drive));
      setText(this.#parts["drive-who"], interpolate(gettext("for %s"), [drive.who]));
    }
    if (going) {
      setText(this.#parts["go-words"], goingText(going));
      setText(this.#parts["go-who"], interpolate(gettext("for %s"), [going.who]));
    }
    if (moves) {
      const { who } = Object.values(limbs).find(({ to_m: to = null }) => to !== null);
      setText(this.#parts["limb-words"], moves);
      setText(this.#parts["limb-who"], interpolate(gettext("for %s"), [who]));
    }
    if (motion) {
      setText(this.#parts["motion-name"], this.#titleOf(motion.name));
      setText(this.#parts["motion-who"], interpolate(gettext("for %s"), [motion.who]));
    }
    if (speech) this.#showSpeech(speech);
  }

  /** @param {boolean} may whether this person may cancel the running motion and speech */
  set mayCancel(may) {
    show(this.#parts["motion-cancel"], may);
    show(this.#parts["speech-cancel"], may);
  }

  /** @param {string} tab that is shown: its chosen topics are shown with it */
  set tab(tab) {
    this.#tab = tab;
    this.#showElsewhere();
  }

  /** @param {?boolean} may whether this tab has control; null: not known yet */
  set mayAct(may) {
    this.#mayAct = may;
    show(this.#parts["drive-cancel"], may === true);
    show(this.#parts["go-cancel"], may === true);
    show(this.#parts["limb-cancel"], may === true);
    this.#showElsewhere();
  }

  close() {
    this.#listening.abort();
  }

  #cancelLimbs() {
    for (const [limb, { to_m: to = null }] of Object.entries(this.#limbs))
      if (to !== null) this.#send({ t: "limb_cancel", limb });
  }

  #showElsewhere() {
    const uses = usesOf(this.#tab).filter((use) => use in this.#chosen);
    const shown = JSON.stringify([uses.map((use) => [use, this.#chosen[use]]), this.#mayAct]);
    if (this.#parts.elsewhere.dataset.shown !== shown) {
      this.#parts.elsewhere.dataset.shown = shown;
      this.#parts.elsewhere.replaceChildren(...uses.map((use) => this.#elsewhere(use)));
    }
    show(this.#parts.running, this.#busy || uses.length > 0);
  }

  #elsewhere(use) {
    const goes = interpolate(
      gettext("%(use)s goes to %(topic)s"),
      { use: useLabel(use), topic: this.#chosen[use] },
      true,
    );
    const row = make("div", {
      className: "runs",
      children: [make("p", { className: "runs-words", text: goes })],
    });
    if (!this.#mayAct) return row;
    const back = makeButton({ className: "button", text: gettext("Default") }, () =>
      this.#send({ t: "choose", use, topic: null }),
    );
    back.setAttribute("aria-label", `${useLabel(use)}: ${gettext("Back to the default")}`);
    row.append(back);
    return row;
  }

  #showSpeech({ text, language, status, word, who }) {
    const line = this.#parts["speech-text"];
    setText(this.#parts["speech-status"], statusText(status));
    setText(this.#parts["speech-who"], interpolate(gettext("for %s"), [who]));
    const [before, spoken, after] = aroundWord(text, word);
    inLanguage(line, language);
    setText(this.#parts["speech-before"], before);
    setText(this.#parts["speech-word"], spoken);
    setText(this.#parts["speech-after"], after);
    const { offsetLeft, offsetWidth, offsetTop, offsetHeight } = this.#parts["speech-word"];
    line.scrollLeft = spoken ? offsetLeft + offsetWidth / 2 - line.clientWidth / 2 : 0;
    line.scrollTop = spoken ? offsetTop + offsetHeight / 2 - line.clientHeight / 2 : 0;
  }
}
