/** Changes that a page sends to the console's REST API, as the person who is signed in. */

import { bodyOf } from "./read.js";

/**
 * @returns {Promise<?object>} the answer; null: it has none
 * @throws {Error} with a sentence for people
 */
export async function send(method, address, body = null, headers = {}) {
  const token = document.querySelector('input[name="csrfmiddlewaretoken"]')?.value ?? "";
  const answer = await fetch(address, {
    method,
    headers: { "Content-Type": "application/json", "X-CSRFToken": token, ...headers },
    body: body === null ? null : JSON.stringify(body),
  }).catch(() => null);
  if (answer?.status === 204) return null;
  const data = await bodyOf(answer);
  if (!answer?.ok || data === null) throw new Error(data?.detail ?? silent());
  return data;
}

/** The sentence for an answer that does not come. */
export function silent() {
  return gettext("The server does not answer. Nothing was changed; try again.");
}
