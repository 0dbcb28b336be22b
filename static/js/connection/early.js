/**
 * Begins what takes a while, while the page's own modules still load: the WebSocket, which `LiveSocket` takes over, and
 * the tab's token. Nothing is sent, so the console counts nobody as present before the page works.
 */

import { tabToken } from "../lib/tab.js";

// A page that was quicker has its own socket: see `LiveSocket`
if (window.earlySocket === undefined) {
  const url = new URL(document.querySelector("[data-opens]").dataset.opens, location.href);
  url.protocol = url.protocol.replace("http", "ws");
  window.earlySocket = new WebSocket(url.href);
}
tabToken();
