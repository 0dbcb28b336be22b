/** The calendar's requests to the console. */

import { bodyOf, readJson } from "../connection/read.js";

const CHANNEL = "bookings";

/** Reads robots and events between two days. */
export function readFeed(url, start, end, robot) {
  const query = new URLSearchParams({ start: start.slice(0, 10), end: end.slice(0, 10) });
  if (robot) query.set("robot", robot);
  return readJson(`${url}?${query}`, gettext("The bookings cannot be read now."));
}

/**
 * Sends a change. @returns {Promise<{ok: boolean, texts: string[], codes: string[], alternatives: object[]}>}
 */
export async function send(url, fields) {
  const token = document.querySelector('input[name="csrfmiddlewaretoken"]').value;
  const answer = await fetch(url, {
    method: "POST",
    headers: { Accept: "application/json", "X-CSRFToken": token },
    body: new URLSearchParams(fields),
  }).catch(() => null);
  const body = await bodyOf(answer);
  if (answer?.ok) {
    new BroadcastChannel(CHANNEL).postMessage("changed");
    return { ok: true, texts: [], codes: [], alternatives: [] };
  }
  const texts = body?.refusals?.map(({ text }) => text) ?? [
    body?.text ?? gettext("The server does not answer. Nothing was changed; try again."),
  ];
  const codes = body?.refusals?.map(({ code }) => code) ?? [];
  return { ok: false, texts, codes, alternatives: body?.alternatives ?? [] };
}

/** Call `changed` when another tab has changed a booking. */
export function bookingsChannel(changed) {
  new BroadcastChannel(CHANNEL).addEventListener("message", changed);
}
