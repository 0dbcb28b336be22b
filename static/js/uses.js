/** What a person's input is used for, each with a topic of its own. */

export const USES = ["drive", "speech", "motions"];

export function useLabel(use) {
  return { drive: gettext("Drive"), speech: gettext("Speech"), motions: gettext("Motions") }[use];
}
