/** Fetches and reads a mesh: STL, Collada, OBJ. A missing, huge or broken mesh: an error with a sentence. */

import { ColladaLoader, Mesh, OBJLoader, STLLoader } from "../../vendor/scene/library.js";

const LARGEST_TEXT = 8_000_000; // bytes: to read a longer text would block the page too long
const FARTHEST_M = 1_000;
const AGAIN_MS = 2_000; // until a mesh is requested once more

const READERS = {
  stl: (bytes) => {
    if (bytes.byteLength > LARGEST_TEXT && isText(bytes)) throw new TooLarge();
    return geometryOf(new STLLoader().parse(bytes));
  },
  dae: (bytes) => {
    // Pictures are not fetched: an address in the file may lead to any server.
    const text = textOf(bytes).replace(/<library_images[\s\S]*?<\/library_images>/g, "");
    return sceneOf(new ColladaLoader().parse(text, "").scene);
  },
  obj: (bytes) => sceneOf(new OBJLoader().parse(textOf(bytes)), true),
};

/**
 * @param {{filename: string, address: string}} entry of the description @param {AbortSignal} signal
 * @returns {Promise<{make: (material: object) => object, triangles: number}>} `make` returns a new part for
 *   each use of the mesh
 */
export async function readMesh({ filename, address }, signal) {
  const bytes = await fetched(filename, address, signal);
  try {
    const kind = filename.toLowerCase().split(".").at(-1);
    return READERS[kind](bytes);
  } catch (error) {
    if (error instanceof TooLarge)
      throw new Error(
        sentence(gettext("“%s” has more than 8 MB of text: too much to draw."), filename),
      );
    throw new Error(sentence(gettext("“%s” is broken and cannot be drawn."), filename));
  }
}

/** Fetch a mesh; try once more if the server is out of reach or reports an error of its own. */
async function fetched(filename, address, signal) {
  for (const pauseMs of [AGAIN_MS, null]) {
    try {
      const answer = await fetch(address, { signal });
      if (answer.ok) return await answer.arrayBuffer();
      if (answer.status < 500) break;
    } catch (error) {
      if (signal.aborted) throw error;
    }
    if (pauseMs !== null) await new Promise((resolve) => setTimeout(resolve, pauseMs));
  }
  throw new Error(sentence(gettext("“%s” could not be fetched."), filename));
}

class TooLarge extends Error {}

function sentence(text, filename) {
  return interpolate(text, [filename]);
}

/**
 * Return whether an STL file is text, by the loader's rule: its length does not fit its number of triangles,
 * and it begins with "solid", perhaps after a byte order mark or an empty line.
 */
function isText(bytes) {
  const triangles = new DataView(bytes).getUint32(80, true);
  const begin = new TextDecoder("latin1").decode(new Uint8Array(bytes, 0, 9));
  return bytes.byteLength !== 84 + 50 * triangles && begin.includes("solid");
}

function textOf(bytes) {
  if (bytes.byteLength > LARGEST_TEXT) throw new TooLarge();
  return new TextDecoder().decode(bytes);
}

function geometryOf(geometry) {
  const triangles = checked(geometry);
  return { make: (material) => new Mesh(geometry, material), triangles };
}

/**
 * @param {object} scene with meshes
 * @param {boolean} plain use the description's materials, not the file's
 */
function sceneOf(scene, plain = false) {
  let triangles = 0;
  scene.traverse((part) => {
    if (part.isMesh) triangles += checked(part.geometry);
  });
  if (triangles === 0) throw new Error("nothing in it");
  const make = (material) => {
    const copy = scene.clone();
    copy.traverse((part) => {
      if (!part.isMesh) return;
      const own = Array.isArray(part.material) ? part.material[0] : part.material;
      const hasColour = !plain && own?.color;
      part.material = material.clone();
      if (hasColour) part.material.color.copy(own.color);
    });
    return copy;
  };
  return { make, triangles };
}

/**
 * Return the number of triangles. Throws if there are none, or if a position is no number or too far away.
 */
function checked(geometry) {
  const places = geometry.getAttribute("position");
  if (!places?.count) throw new Error("nothing in it");
  geometry.computeBoundingBox();
  const { min, max } = geometry.boundingBox;
  const ends = [min.x, min.y, min.z, max.x, max.y, max.z];
  if (!ends.every((end) => Math.abs(end) < FARTHEST_M * 1000)) throw new Error("no places");
  if (!geometry.getAttribute("normal")) geometry.computeVertexNormals();
  return (geometry.index?.count ?? places.count) / 3;
}
