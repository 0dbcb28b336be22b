import { afterEach, beforeEach, expect, it, vi } from "vitest";
import { bringUpToDate, keepFresh } from "../../../static/js/calendar/live_lists.js";

const page = (rows, token = "a") => `
  <p id="head">head ${token}</p>
  <div id="day" data-live><ul>${rows}</ul><form><input type="hidden" name="csrfmiddlewaretoken" value="${token}"><button>Cancel</button></form></div>`;
const day = () => document.querySelector("#day ul").textContent;
let sockets = [];

beforeEach(() => {
  sockets = [];
  document.body.innerHTML = page("<li>one</li>");
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

it("replaces the parts that differ, and no others", () => {
  const button = document.querySelector("button");
  expect(bringUpToDate(page("<li>one</li>", "b"))).toBe(false);
  expect(document.querySelector("button")).toBe(button); // a new token is no change
  bringUpToDate(page("<li>one</li><li>two</li>", "b"));
  expect([day(), document.querySelector("#head").textContent]).toEqual(["onetwo", "head a"]);
});

it("leaves alone what somebody holds, until they let go", () => {
  document.querySelector("button").focus();
  expect(bringUpToDate(page("<li>two</li>"))).toBe(true);
  expect(day()).toBe("one");
  document.querySelector("button").blur();
  document.body.insertAdjacentHTML("beforeend", "<dialog open></dialog>");
  expect(bringUpToDate(page("<li>two</li>"))).toBe(true);
  document.querySelector("dialog").remove();
  expect(bringUpToDate(page("<li>two</li>"))).toBe(false);
  expect(day()).toBe("two");
});

it("reads the page again after a hint, but not after the one that comes when it opens", async () => {
  class Socket extends EventTarget {
    constructor() {
      super();
      sockets.push(this);
    }
    send() {}
    close() {}
  }
  vi.stubGlobal("WebSocket", Socket);
  const fetched = vi.fn(() =>
    Promise.resolve({
      ok: true,
      redirected: false,
      text: () => Promise.resolve(page("<li>new</li>")),
    }),
  );
  vi.stubGlobal("fetch", fetched);
  keepFresh("/ws/bookings/");
  const [socket] = sockets;
  const hint = () =>
    socket.dispatchEvent(
      new MessageEvent("message", { data: JSON.stringify({ t: "bookings_changed" }) }),
    );
  hint();
  expect(fetched).not.toHaveBeenCalled();
  hint();
  await vi.waitFor(() => expect(day()).toBe("new"));
});
