/** Waiting times between attempts to connect: doubling, with jitter, never longer than the last. */

const FIRST_MS = 250;
const LONGEST_MS = 2000;

/**
 * Waiting time before attempt number `attempt` (0 is the first after a loss).
 * Jitter takes up to a fifth off, so that many pages do not return in one moment.
 * @param {number} attempt
 * @param {() => number} random
 * @returns {number} milliseconds
 */
export function waitBefore(attempt, random = Math.random) {
  const full = Math.min(FIRST_MS * 2 ** Math.min(attempt, 10), LONGEST_MS);
  return full * (1 - 0.2 * random());
}
