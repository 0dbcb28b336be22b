/** A robot's card on the fleet page and on the lab's monitor. */

import { mark, say, sayOrHide } from "../lib/dom.js";
import { bookingWords } from "./card_words.js";

/** Show how a robot is, except its stop. @param {object} shown as of `cardOf` @param {object} robot as it was heard */
export function showRobot({ card, own }, shown, robot) {
  mark(card, "level", shown.level);
  mark(card, "stopped", shown.stopped);
  mark(own.status, "level", shown.level);
  say(own.status, shown.status);
  say(own.doing, shown.doing);
  sayOrHide(own.why, shown.why);
  say(own.battery, shown.battery);
  say(own.health, shown.health);
  mark(own.health, "level", shown.healthLevel);
  say(own.driver, shown.driver);
  say(own.booking, bookingWords(robot));
  say(own.gate, shown.gate);
}

/** Show its stop as the robot reports it. */
export function showStop({ own }, shown) {
  say(own["stop-state"], shown.stop);
  mark(own["stop-state"], "fresh", false);
  sayOrHide(own["stop-why"], shown.stopWhy);
}
