/** The robot's recorded motions: a list and one button, which plays and, while one runs, cancels. */

import { make, say, show } from "./dom.js";

/** How the last motion ended, in words. */
export function endText({ name, outcome, text }) {
  if (outcome === "succeeded") return `${name}: done.`;
  return text ? `${name}: ${outcome.replace("_", " ")}. ${text}` : `${name}: ${outcome}.`;
}

export class Motions {
  #parts;
  #send;
  #fence = null;
  #running = null;
  #listening = new AbortController();

  /** @param {{motions, "motion-choice", "motion-play", "motion-state"}} parts @param {(message: object) => void} send */
  constructor(parts, send) {
    this.#parts = parts;
    this.#send = send;
    this.#enable();
    parts["motion-play"].addEventListener("click", () => this.#press(), {
      signal: this.#listening.signal,
    });
  }

  /** @param {object} state of the robot */
  set state({ motions = [], motion = null, motion_ended: ended = null }) {
    this.#running = motion;
    show(this.#parts.motions, motions.length > 0);
    this.#offer(motions);
    say(this.#parts["motion-play"], motion ? "Cancel" : "Play");
    const words = motion ? `${motion.name}, for ${motion.who}` : ended ? endText(ended) : "";
    say(this.#parts["motion-state"], words);
    this.#enable();
  }

  /** @param {?number} fence of this tab's control; null: it has none */
  set fence(fence) {
    this.#fence = fence;
    this.#enable();
  }

  close() {
    this.#listening.abort();
  }

  #press() {
    const fence = this.#fence;
    if (this.#running) this.#send({ t: "play_cancel", fence });
    else this.#send({ t: "play", fence, motion: this.#parts["motion-choice"].value });
  }

  #offer(motions) {
    const choice = this.#parts["motion-choice"];
    const offered = [...choice.options].map((option) => option.value);
    if (offered.join("\n") === motions.join("\n")) return;
    const chosen = choice.value;
    choice.replaceChildren(...motions.map((name) => make("option", { text: name })));
    if (motions.includes(chosen)) choice.value = chosen;
  }

  #enable() {
    this.#parts["motion-play"].disabled = this.#fence === null;
    this.#parts["motion-choice"].disabled = this.#fence === null || this.#running !== null;
  }
}
