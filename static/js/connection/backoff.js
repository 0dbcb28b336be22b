/** Waiting times between attempts to connect: they double, up to a longest time, with jitter. */

const FIRST_MS = 250;
const LONGEST_MS = 2000;

/**
 * Return the waiting time before attempt number `attempt` (0 is the first after a loss).
 * Jitter shortens it by up to a fifth, so that many pages do not connect again at the same moment.
 * @param {number} attempt
 * @param {() => number} random
 * @param {number} longestMs
 * @returns {number} milliseconds
 */
export function waitBefore(attempt, random = Math.random, longestMs = LONGEST_MS) {
  const full = Math.min(FIRST_MS * 2 ** Math.min(attempt, 10), longestMs);
  return full * (1 - 0.2 * random());
}
