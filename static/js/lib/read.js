/** What a page reads from the console when somebody looks, besides what it is told live. */

/**
 * What an address answers.
 * @param {string} failed what to say where the console itself said nothing
 * @throws {Error} with words for a person
 */
export async function readJson(url, failed) {
  const answer = await fetch(url, { headers: { Accept: "application/json" } }).catch(() => null);
  const body = await answer?.json().catch(() => null);
  if (!answer?.ok || body === null) throw new Error(body?.text ?? failed);
  return body;
}
