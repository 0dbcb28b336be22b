/** What a person's input is used for, each with a topic of its own. */

export const USES = ["drive", "speech", "motions"];

export function useLabel(use) {
  return { drive: gettext("Drive"), speech: gettext("Speech"), motions: gettext("Motions") }[use];
}

/** Those of a tab: the topics tab has rows for all of them. */
export function usesOf(tab) {
  if (tab === "centre") return USES;
  return USES.filter((use) => use === tab);
}
