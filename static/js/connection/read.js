/** Requests of a page to the console, in addition to the live connection. */

/**
 * Reads JSON from a URL.
 * @param {string} failed error text if the console sent none
 * @throws {Error} with a sentence for people
 */
export async function readJson(url, failed) {
  const answer = await fetch(url, { headers: { Accept: "application/json" } }).catch(() => null);
  const body = await answer?.json().catch(() => null);
  if (!answer?.ok || body === null) throw new Error(body?.detail ?? body?.text ?? failed);
  return body;
}
