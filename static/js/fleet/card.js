/** A robot's card on the fleet page and on the lab's monitor. */

import { mark, setText, setTextOrHide, show } from "../lib/dom.js";
import { bookingWords, turnWords } from "./card_words.js";

/**
 * Show a robot's state, except its stop.
 * @param {object} shown from `cardOf`
 * @param {object} robot as the console sent it
 */
export function showRobot({ card, own }, shown, robot) {
  mark(card, "level", shown.level);
  mark(card, "unknown", !robot.state);
  mark(card, "stopped", shown.stopped);
  mark(card, "silent", shown.old);
  mark(card, "alarm", shown.alarm !== "");
  setText(own.alarm, shown.alarm); // read at once by a screen reader, once
  mark(own.status, "level", shown.level);
  setText(own.status, shown.status);
  setText(own.doing, shown.doing);
  setTextOrHide(own.why, shown.why);
  setTextOrHide(own.recorded, shown.recorded);
  setText(own.battery, shown.battery);
  setText(own.health, shown.health);
  mark(own.health, "level", shown.healthLevel);
  setText(own.driver, shown.driver);
  setText(own.booking, bookingWords(robot));
  setTextOrHide(own.turn, turnWords(robot));
  mark(own.turn, "called", Boolean(robot.booked?.turn?.person) && !robot.booked.turn.driving);
  setText(own.gate, shown.gate);
  // Of a robot that stays out of service, the console would refuse it.
  if (own.book) show(own.book, !robot.out || robot.free_in_s !== null);
}

/** Show the robot's stop as the robot reports it. */
export function showStop({ own }, shown) {
  setText(own["stop-state"], shown.stop);
  mark(own["stop-state"], "fresh", false);
  setTextOrHide(own["stop-why"], shown.stopWhy);
}
