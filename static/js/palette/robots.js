/** The robots whose pages this person may open, in the palette. */

import { readJson } from "../connection/read.js";

/** @param {?string} [here] slug of the robot whose page this is @returns {Promise<import("./palette.js").Entry[]>} */
export async function robots(here = null) {
  const read = await readJson("/api/v1/robots", gettext("The robots could not be read."));
  return read.robots
    .filter(({ slug, enabled }) => enabled && slug !== here)
    .map(({ slug, name, profile }) => ({
      name,
      does: gettext("Robot: opens its page"),
      more: `${slug} ${profile}`,
      act: () => location.assign(`/robots/${slug}/`),
    }));
}
