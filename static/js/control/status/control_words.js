/** The holder of control, and this person's actions, in words from the server's `control`. Pure. */

import { clockText } from "../lease.js";

const SOON_S = 4 * 3600; // a later booking is not shown
const FAR_S = 3600;
const WARNINGS_S = [60, 300]; // before a slot ends control

/** Return the holder's name for this page. */
function holder(control) {
  return control.holder ?? gettext("Somebody");
}

/**
 * @param {object} control the server's newest `control`
 * @param {number | null} resumableS seconds until a holder whose page is gone loses control
 * @param {number | null} offerS seconds for which a free robot is offered to this person
 * @param {string} silent the part of the way to the robot that does not answer (`silenceOf`); empty: none
 * @returns {{headline: string, reason: string, actions: string[]}}
 *   actions: take, take_back, take_over, renew, release, ask, ask_cancel; the first is the most likely one
 */
export function controlWords(control, resumableS = null, offerS = null, silent = "") {
  const reason = control.refusal?.text ?? "";
  const force = control.may_take_back ? ["take_back"] : control.may_take_over ? ["take_over"] : [];
  const asks = (control.asking ?? null) !== null || isInLesson(control.lesson);
  const question = asks ? "ask_cancel" : "ask";
  switch (control.state) {
    case "unknown":
      return { headline: gettext("Control is not known"), reason: "", actions: [] };
    case "free":
      if (offerS !== null)
        return {
          headline: gettext("It is your turn"),
          reason: interpolate(
            gettext("Take control within %s s, or the next one in line gets it."),
            [Math.ceil(offerS)],
          ),
          actions: ["take", "ask_cancel"],
        };
      return {
        headline: gettext("Nobody has control"),
        reason:
          question === "ask_cancel" && !control.lesson
            ? `${placeWords(control)} ${reason}`.trim()
            : reason,
        actions: reason ? [...(mayWait(control) ? [question] : []), ...force] : ["take"],
      };
    case "yours":
      return {
        headline: silent ? gettext("No contact: you cannot drive") : gettext("You have control"),
        reason: "",
        actions: silent === "console" ? ["release"] : ["renew", "release"], // an end is always asked for
      };
    case "elsewhere":
      return {
        headline: gettext("You have control in another tab"),
        reason,
        actions: reason ? [] : ["take"],
      };
    case "away": {
      const gone = gettext("Their page is gone.");
      const wait = gettext("Their page is gone. Free in %s s unless it returns.");
      return {
        headline: interpolate(gettext("%s has control"), [holder(control)]),
        reason: resumableS === null ? gone : interpolate(wait, [Math.ceil(resumableS)]),
        actions: reason ? force : ["take"], // taking over from the person's own vanished page needs no force
      };
    }
    default:
      return {
        headline: interpolate(gettext("%s has control"), [holder(control)]),
        reason: question === "ask_cancel" && !control.lesson ? placeWords(control) : "",
        actions: [question, ...force],
      };
  }
}

/** Return whether this person has a turn in the present lesson, or waits for one. */
export function isInLesson(lesson) {
  return Boolean(lesson && (lesson.yours || (lesson.place ?? null) !== null));
}

/**
 * Return a text about the lesson that runs now, for its people and who leads it; empty if there is none.
 * @param {number} sinceS seconds since `control` came
 */
export function lessonWords({ state, lesson }, sinceS) {
  if (!lesson) return "";
  const left = clockText(Math.max((lesson.turn_s ?? 0) - sinceS, 0));
  if (lesson.yours)
    return lesson.driving
      ? `${gettext("Your turn.")} ${waitingWords(lesson)}`
      : interpolate(gettext("Your turn: take control within %s"), [left]);
  const words = [];
  if (lesson.held) words.push(gettext("The line is held."));
  else if (lesson.turn && state !== "yours")
    words.push(
      interpolate(
        lesson.driving ? gettext("%s drives, %s left.") : gettext("%s is called, %s left."),
        [lesson.turn, left],
      ),
    );
  if (lesson.place) words.push(interpolate(gettext("Your place in line: %s."), [lesson.place]));
  else if (lesson.leads) words.push(waitingWords(lesson));
  return words.join(" ");
}

function waitingWords({ waiting }) {
  return interpolate(ngettext("%s person waits.", "%s people wait.", waiting), [waiting]);
}

/** Return whether waiting in line helps: others may take control now, and this person later. */
function mayWait({ refusal }) {
  return ["next_in_line", "booked", "not_your_turn"].includes(refusal?.code);
}

/** This person's place in line. */
function placeWords({ ahead }) {
  if (!ahead) return gettext("You are the next in line.");
  return interpolate(
    ngettext(
      "You wait in line: %s person is before you.",
      "You wait in line: %s people are before you.",
      ahead,
    ),
    [ahead],
  );
}

/**
 * Return a text about the current booking, or the next booking; empty if there is none soon.
 * @param {object} control the server's newest `control`
 * @param {number} sinceS seconds since `control` came
 */
export function slotWords({ state, booked, next_booked: next, lesson = null }, sinceS) {
  if (lesson) return ""; // its line says more
  // In the holder's own slot, the panel already shows above how long control lasts: as long as the slot.
  if (booked && !(booked.mine && state === "yours")) {
    const left = clockText(Math.max(booked.seconds - sinceS, 0));
    if (booked.mine) return interpolate(gettext("Your slot: %s left"), [left]);
    return interpolate(gettext("%s has a slot, %s left"), [booked.name, left]);
  }
  if (!next || next.seconds - sinceS > SOON_S) return "";
  const begins = clockText(Math.max(next.seconds - sinceS, 0));
  if (next.mine) return interpolate(gettext("Your slot begins in %s"), [begins]);
  return interpolate(gettext("The slot of %s begins in %s"), [next.name, begins]);
}

/** Return whether a small screen may hide the words about a slot: no slot now, and the next begins late. */
export function isSlotFar({ booked, next_booked: next }, sinceS) {
  return !booked && next !== null && next !== undefined && next.seconds - sinceS > FAR_S;
}

/**
 * Return the newest warning that is due, 5 minutes and 1 minute before a slot, or an out-of-service period,
 * ends this person's control.
 * @returns {{atS: number, text: string, ending: string} | null} `ending`: the kind of end, to tell two ends
 *   apart
 */
export function slotWarning({ state, booked, next_booked: next, out_s: outS = null }, sinceS) {
  if (state !== "yours") return null;
  const other = booked || next?.mine ? null : next;
  const out = outS === null ? null : { seconds: outS };
  const [ends] = [booked?.mine ? booked : null, other, out]
    .filter(Boolean)
    .sort((one, another) => one.seconds - another.seconds);
  if (!ends) return null;
  const left = ends.seconds - sinceS;
  const atS = WARNINGS_S.find((limit) => left <= limit);
  if (atS === undefined || left <= 0) return null;
  const minutes = Math.ceil(left / 60);
  const text =
    ends === out
      ? gettext("The robot is out of service in %s min: control ends then.")
      : ends === booked
        ? gettext("Your slot ends in %s min: control ends with it.")
        : gettext("The slot of another person begins in %s min: control ends then.");
  return { atS, text: interpolate(text, [minutes]), ending: text };
}
