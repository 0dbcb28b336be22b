import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";

const parse = vi.hoisted(() => vi.fn());

vi.mock("../../../static/vendor/scene/library.js", () => ({
  ColladaLoader: class {},
  Mesh: class {},
  OBJLoader: class {},
  STLLoader: class {
    parse = parse;
  },
}));

const { readMesh } = await import("../../../static/js/scene/meshes.js");

const POINT = { count: 3 };
const GEOMETRY = {
  getAttribute: () => POINT,
  computeBoundingBox: () => {},
  boundingBox: { min: { x: 0, y: 0, z: 0 }, max: { x: 1, y: 1, z: 1 } },
};

/** Return a file of this length that begins with this text. */
function file(length, text, triangles = 0) {
  const bytes = new Uint8Array(length);
  bytes.set(new TextEncoder().encode(text));
  new DataView(bytes.buffer).setUint32(80, triangles, true);
  return bytes.buffer;
}

function read(bytes) {
  vi.stubGlobal("fetch", async () => ({ ok: true, arrayBuffer: async () => bytes }));
  const entry = { filename: "package://arm/hand.STL", address: "/hand" };
  return readMesh(entry, new AbortController().signal);
}

beforeEach(() => parse.mockReset().mockReturnValue(GEOMETRY));
afterEach(() => vi.unstubAllGlobals());

describe("a mesh", () => {
  it("of STL in words is refused above 8 MB, before it is read", async () => {
    await expect(read(file(8_000_001, "solid hand"))).rejects.toThrow("8 MB of text");
    expect(parse).not.toHaveBeenCalled();
    expect((await read(file(8_000_000, "solid hand"))).triangles).toBe(1);
  });

  it("of binary STL may be larger, also with a head that begins with solid", async () => {
    const triangles = 200_000;
    for (const head of ["solid hand", "made by a program"])
      expect((await read(file(84 + 50 * triangles, head, triangles))).triangles).toBe(1);
  });
});
