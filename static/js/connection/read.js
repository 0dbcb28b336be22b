/** Requests of a page to the console, in addition to the live connection. */

import { inPageLanguage } from "../formats/sentences.js";

/** The JSON of an answer, with sentences in the page's language; null if it has none. @param {?Response} answer */
export async function bodyOf(answer) {
  return inPageLanguage((await answer?.json().catch(() => null)) ?? null);
}

/**
 * Reads JSON from a URL.
 * @param {string} failed error text if the console sent none
 * @throws {Error} with a sentence for people
 */
export async function readJson(url, failed) {
  const answer = await fetch(url, { headers: { Accept: "application/json" } }).catch(() => null);
  const body = await bodyOf(answer);
  if (!answer?.ok || body === null) throw new Error(body?.detail ?? body?.text ?? failed);
  return body;
}
