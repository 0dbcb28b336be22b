/** Requests to drive to a place. Pure. */

/** Return a pose in steps of 1 mm and 1 mrad. */
export function rounded(pose) {
  if (pose === null) return null;
  const millimetres = (value) => Math.round(value * 1000) / 1000;
  return { x: millimetres(pose.x), y: millimetres(pose.y), heading: millimetres(pose.heading) };
}

/** Return the request to drive to a named place of the robot's map. */
export function goRequest(place) {
  return { t: "go", ...rounded(place), place: place.name };
}
