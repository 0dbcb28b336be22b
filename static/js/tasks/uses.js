/** Uses of a person's input, each with its own topic. */

export const USES = ["drive", "speech", "motions"];

export function useLabel(use) {
  return { drive: gettext("Drive"), speech: gettext("Speech"), motions: gettext("Motions") }[use];
}

/** Uses of a tab: the topics tab has rows for all of them. */
export function usesOf(tab) {
  if (tab === "centre") return USES;
  return USES.filter((use) => use === tab);
}
