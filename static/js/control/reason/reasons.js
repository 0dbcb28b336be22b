/** All reasons at one moment why the robot does not do what the person wants, the most important first. Pure. */

import { faultsOf, unconfirmedStop, warningsOf } from "./faults.js";
import { gateReason } from "./gate_words.js";

/**
 * @param {object} now as `faultsOf` takes it, and:
 * @param {string} now.unconfirmed why nobody has confirmed the stop that this person pressed; empty: it is
 * @param {string} now.asks a question of the page to the hand that holds the stick; empty: none
 * @param {?object} now.wish the person tried to drive without control: a `Reason`
 * @param {?object} now.ended the last task that failed: a `Reason`
 * @param {boolean} now.mayAct this page has control: only then has the gate's reason its button
 * @param {boolean} now.asksNeutral this page has control, and its stick must return to the middle first
 * @param {?object} now.recent the gate's reason of a moment ago: a `Reason`
 * @param {string} now.hint a word about what the hand does; empty: none
 * @returns {import("./faults.js").Reason[]}
 */
export function reasonsOf(now) {
  const { state, silence, unconfirmed, asks, wish, ended, mayAct } = now;
  const { asksNeutral, recent, hint } = now;
  const found = unconfirmed ? [unconfirmedStop(unconfirmed)] : [];
  found.push(...faultsOf(now));
  if (wish) found.push(wish);
  const isWhole = state && !silence && state.stop.state === "clear";
  if (isWhole) {
    if (asks) found.push({ level: "warning", title: asks });
    const held = gateReason(state.verdict);
    const offered = (reason) =>
      mayAct && !state.drive_by ? reason : { ...reason, act: undefined };
    if (held) found.push(offered(held));
    if (asksNeutral && !state.motion) found.push(neutral(state.neutral_needed));
    if (ended) found.push(ended);
    // Its button stays: most of them need a stick at rest.
    if (!held && recent) found.push({ ...offered(recent), level: "info" });
    if (hint) found.push({ level: "info", title: hint });
    found.push(...warningsOf(state));
  }
  return found.filter(({ title }, i) => found.findIndex((other) => other.title === title) === i);
}

function neutral(needed) {
  const why = needed?.text ?? "";
  return {
    level: "info",
    title: gettext("Let the stick return to the middle"),
    text: why && `${why.charAt(0).toUpperCase()}${why.slice(1)}.`.replace("..", "."),
  };
}
