/** Uses of a person's input, each with its own topic. */

export const USES = ["drive", "speech", "motions"];

export function useLabel(use) {
  return { drive: gettext("Drive"), speech: gettext("Speech"), motions: gettext("Motions") }[use];
}

/** Return the uses whose chosen topics a tab shows. The topics tab has its own rows for all uses. */
export function usesOf(tab) {
  if (tab === "centre") return USES;
  return USES.filter((use) => use === tab);
}
