/** The side panel: sensors, speed limits, watchers, refusals. */

import { ageText } from "../../formats/ages.js";
import { pageLanguage } from "../../formats/languages.js";
import { number } from "../../formats/numbers.js";
import { timeText } from "../../formats/times.js";
import { fill, make, setText, setTextOrHide, show } from "../../lib/dom.js";
import { namesOf, plain, sensorName, stickWords } from "./plain_words.js";
import { overloadText, watchdogText } from "./status_text.js";

function sensorText({ ok, age_s: ageS, text }) {
  if (text) return text;
  if (ageS === null) return gettext("never seen");
  return ok ? gettext("ok") : interpolate(gettext("%s old"), [ageText(1000 * ageS)]);
}

export function latencyText({ latency_s: latencyS, latency_measured: measured }) {
  const text = `${Math.round(latencyS * 1000)} ms`;
  return measured ? text : interpolate(gettext("%s (assumed)"), [text]);
}

export function watchersText({ watchers, watchers_more: more }) {
  const names = more ? [...watchers, interpolate(gettext("%s more"), [more])] : watchers;
  return names.join(", ") || gettext("Nobody");
}

/** Return a text about the difference of both clocks, if there is one. Positive: the robot's is ahead. */
export function skewText({ clock_skew_s: skewS }) {
  if (!skewS) return "";
  const text =
    skewS > 0
      ? gettext("The robot’s clock is %s s ahead of the server’s.")
      : gettext("The robot’s clock is %s s behind the server’s.");
  return interpolate(text, [number(Math.abs(skewS), 1)]);
}

/** Return a count as text; a large count is rounded. */
function roughly(count) {
  if (count < 100) return String(count);
  const rounded = Number(count.toPrecision(2)).toLocaleString(pageLanguage());
  return interpolate(gettext("about %s"), [rounded]);
}

/** Make a row: a sensor's plain name over its technical name, and its state. */
function sensorRow() {
  const name = make("span", { className: "first-upper", children: [make("span"), make("code")] });
  return make("li", { children: [name, make("span")] });
}

export class Details {
  #parts;
  #names = new Map(); // of distance sensors

  constructor(parts) {
    this.#parts = parts;
    // The present reasons are at the top; a browser opens it where it was left.
    parts.details.addEventListener("toggle", () => {
      parts.details.scrollTop = 0;
    });
  }

  set facts({ sonars, stick, drive_topic: topic, profile }) {
    this.#names = namesOf(sonars);
    setText(this.#parts["drive-topic"], topic);
    setText(this.#parts.profile, profile);
    setText(this.#parts["stick-words"], stickWords(stick));
    setText(this.#parts["stick-steps"], stick);
  }

  /** @param {import("../reason/faults.js").Reason[]} reasons all of this moment, with the engineers' words */
  set now(reasons) {
    const rows = reasons.map(({ title, text = "", detail = "" }) =>
      [title, text, plain(detail, this.#names)].filter(Boolean).join(" · "),
    );
    fill(
      this.#parts["reasons-now"],
      rows.length ? rows : [gettext("Nothing holds the robot back")],
    );
  }

  /** @param {{reason: object, limit: number, at: Date}[]} interventions the last ones, newest first */
  set interventions(interventions) {
    const rows = interventions.map(({ reason, limit, at }) => {
      const speed =
        limit > 0 ? interpolate(gettext("%s m/s"), [number(limit, 2)]) : gettext("stood");
      return `${timeText(at)}: ${plain(reason.detail ?? reason.title, this.#names)} (${speed})`;
    });
    fill(this.#parts.reasons, rows.length ? rows : [gettext("Nothing yet")]);
  }

  set state(state) {
    const { watchers, sensors, clock, latency, foreign, refusals } = this.#parts;
    const { "all-limits": limits, overload, watchdog } = this.#parts;
    const { limits: speedLimits = [] } = state.verdict;
    const texts = speedLimits.map(({ text }) => plain(text, this.#names));
    fill(limits, texts.length ? texts : [gettext("None")]);
    setText(latency, latencyText(state));
    setText(watchers, watchersText(state));
    this.#showSensors(sensors, state.sensors);
    setTextOrHide(clock, skewText(state));
    setTextOrHide(overload, overloadText(state));
    setTextOrHide(watchdog, watchdogText(state));
    show(foreign, state.foreign.length > 0);
    setText(
      foreign,
      interpolate(gettext("Also publishing to the drive topic: %s"), [state.foreign.join(", ")]),
    );
    const counts = Object.entries(state.refused).map(
      ([code, count]) => `${gettext(code.replaceAll("_", " "))}: ${roughly(count)}`, // as all pages show codes
    );
    fill(refusals, counts.length ? counts : [gettext("None")]);
  }

  #showSensors(list, sensors) {
    sensors.forEach((sensor, i) => {
      const row = list.children[i] ?? list.appendChild(sensorRow());
      const [name, technical] = row.children[0].children;
      setText(name, sensorName(sensor, this.#names));
      setText(technical, sensor.name);
      setText(row.children[1], plain(sensorText(sensor), this.#names));
      row.dataset.level = sensor.ok ? "ok" : "fail";
    });
    while (list.children.length > sensors.length) list.lastElementChild.remove();
  }
}
