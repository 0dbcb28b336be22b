/** The channels of a recording: each publisher, and each type that a topic had, has its own. Pure. */

/** Return the topics of channels, each once. */
export function topics(channels) {
  return [...new Set(channels.map(({ topic }) => topic))];
}
