/** The places on the robot's map in the palette. */

import { whyNotNow } from "../control/lease.js";
import { readMaps } from "../navigation/places_api.js";
import { goRequest } from "../navigation/requests.js";
import { leftOf } from "../tasks/lesson_tasks.js";

/** @param {import("./control_palette.js").Driving} driving @returns {Promise<import("./palette.js").Entry[]>} */
export async function places({ data, tasks, hasMap, mayAct, request }) {
  if (!hasMap()) return [];
  const maps = await readMaps(data.robot);
  const now = maps.find(({ robots }) => robots.length > 0);
  const left = leftOf(tasks(), "places", now?.places ?? [], ({ name }) => name);
  return left.map((place) => ({
    name: place.name,
    does: gettext("Place: the robot drives there"),
    why: () => (mayAct() ? "" : whyNotNow()),
    act: () => request(goRequest(place)),
  }));
}
