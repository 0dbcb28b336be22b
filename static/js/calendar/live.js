/** News of bookings: the console hints that something changed, and a page reads again what its person may see. */

import { Heartbeat } from "../connection/heartbeat.js";
import { LiveSocket, socketUrl } from "../connection/socket.js";

/**
 * Call `changed` when a booking has changed.
 * @param {string} path of the WebSocket
 * @param {{turns?: boolean}} options `turns`: also when a turn of a lesson has changed
 */
export function listen(path, changed, { turns = false } = {}) {
  const socket = new LiveSocket(socketUrl(path));
  const heartbeat = new Heartbeat(socket);
  socket.addEventListener("open", () => heartbeat.begin());
  socket.addEventListener("message", ({ detail }) => {
    heartbeat.receive(detail);
    if (detail.t === "bookings_changed" && (turns || !detail.turns)) changed();
  });
  socket.connect();
  return {
    close: () => {
      heartbeat.close();
      socket.close();
    },
  };
}

/** Returns a function that calls `step` at once, and again after `pauseMs`, once for all calls in between. */
export function atMost(step, pauseMs) {
  let resting = false;
  let asked = false;
  const call = () => {
    if (resting) {
      asked = true;
      return;
    }
    resting = true;
    step();
    setTimeout(() => {
      resting = false;
      if (asked) {
        asked = false;
        call();
      }
    }, pauseMs);
  };
  return call;
}
