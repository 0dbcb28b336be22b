/** Maps and their places: the console's REST API, as the person who is signed in. */

import { bodyOf, readJson } from "../connection/read.js";
import { send, silent } from "../connection/write.js";

const MAPS = "/api/v1/maps";

/**
 * Return present and earlier maps, of one robot or of all robots that this person may see.
 * @returns {Promise<object[]>}
 */
export async function readMaps(robot = null) {
  const query = robot === null ? "" : `?robot=${encodeURIComponent(robot)}`;
  return (await readJson(MAPS + query, gettext("The map could not be read."))).maps;
}

/** @param {object} map @returns {Promise<HTMLImageElement>} its picture; the browser keeps it in its cache */
export async function readPicture(map) {
  const picture = new Image();
  picture.src = map.picture;
  try {
    await picture.decode();
  } catch {
    throw new Error(gettext("The picture of the map could not be read."));
  }
  return picture;
}

export function addPlace(map, place) {
  return send("POST", `${MAPS}/${map.map}/places`, place);
}

export function deletePlace(map, place) {
  return send("DELETE", placeAddress(map, place));
}

/** @param {object} place as it was read @param {object} changes */
export function changePlace(map, place, changes) {
  const unchanged = (now) =>
    now.name === place.name && ["x", "y", "heading"].every((part) => now[part] === place[part]);
  return edit(placeAddress(map, place), changes, unchanged);
}

export function nameMap(map, name) {
  return edit(`${MAPS}/${map.map}`, { name }, (now) => now.name === map.name);
}

/** @param {string} csv the content of a file */
export function importPlaces(map, csv) {
  return send("POST", `${MAPS}/${map.map}/places/import`, { csv });
}

/** @returns {string} the address of the file of places for spreadsheets */
export function exportAddress(map) {
  return `/maps/${map.map}/places.csv`;
}

function placeAddress(map, place) {
  return `${MAPS}/${map.map}/places/${place.number}`;
}

/** Send changes, but only if the data is still as this person saw it. */
async function edit(address, changes, unchanged) {
  const answer = await fetch(address).catch(() => null);
  const now = await bodyOf(answer);
  if (!answer?.ok || now === null) throw new Error(now?.detail ?? silent());
  if (!unchanged(now))
    throw new Error(gettext("It has changed meanwhile. Check the new values, then try again."));
  return send("PATCH", address, changes, { "If-Match": answer.headers.get("ETag") });
}
