/** The work of a device by itself: it shows pushes, opens their page, and ends them when its person signs out. */

import { readFileSync } from "node:fs";
import { afterEach, expect, test, vi } from "vitest";
import { whyNot } from "../../../static/js/accounts/devices.js";
import { signOut } from "../../../static/js/page/app.js";

afterEach(() => vi.unstubAllGlobals());

function worker(pages = []) {
  const heard = {};
  const self = {
    addEventListener: (type, act) => {
      heard[type] = act;
    },
    location: { origin: "https://fleet.example" },
    registration: { showNotification: vi.fn() },
    clients: { matchAll: async () => pages, openWindow: vi.fn() },
  };
  const text = readFileSync("templates/site/service_worker.js", "utf8").replace(
    /{[%{].*?[%}]}/g,
    "",
  );
  new Function("self", text)(self);
  return { self, heard };
}

async function fire(act, event) {
  const waits = [];
  act({ ...event, waitUntil: (work) => waits.push(work) });
  await Promise.all(waits);
}

const PUSH = {
  title: "TIAGo 1: your turn",
  body: "Take control",
  path: "/robots/tiago-1/",
  tag: "7",
};

test("a push is shown, and a press on it opens its page", async () => {
  const { self, heard } = worker();
  await fire(heard.push, { data: { json: () => PUSH } });
  const [title, shown] = self.registration.showNotification.mock.calls[0];
  expect([title, shown.body, shown.tag]).toEqual([PUSH.title, PUSH.body, "7"]);
  const close = vi.fn();
  await fire(heard.notificationclick, { notification: { data: shown.data, close } });
  expect(close).toHaveBeenCalled();
  expect(self.clients.openWindow).toHaveBeenCalledWith("https://fleet.example/robots/tiago-1/");
});

test("a press shows the page that is open", async () => {
  const page = { url: "https://fleet.example/robots/tiago-1/", focus: vi.fn() };
  const { self, heard } = worker([page]);
  await fire(heard.notificationclick, { notification: { data: PUSH, close: () => {} } });
  expect(page.focus).toHaveBeenCalled();
  expect(self.clients.openWindow).not.toHaveBeenCalled();
});

test("who signs out ends the notifications of the browser first", async () => {
  const done = [];
  const unsubscribe = async () => done.push("unsubscribed");
  const pushManager = { getSubscription: async () => ({ unsubscribe }) };
  vi.stubGlobal("navigator", { serviceWorker: { getRegistration: async () => ({ pushManager }) } });
  vi.stubGlobal("Notification", { permission: "granted" });
  const preventDefault = () => done.push("waits");
  await signOut({ preventDefault, target: { submit: () => done.push("signed out") } });
  expect(done).toEqual(["waits", "unsubscribed", "signed out"]);
});

test("a browser that cannot get notifications says why, and what to do", () => {
  const able = {
    isSecureContext: true,
    PushManager: {},
    navigator: { serviceWorker: {} },
    Notification: { permission: "default" },
  };
  expect(whyNot(able)).toBe(null);
  expect(whyNot({ ...able, isSecureContext: false })).toMatch("https");
  expect(whyNot({ isSecureContext: true, navigator: {} })).toMatch("home screen");
  expect(whyNot({ ...able, Notification: { permission: "denied" } })).toMatch("allow them");
});
