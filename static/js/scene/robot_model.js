/**
 * The robot, built from its description: links, joints, meshes. Where a mesh is missing, simple shapes
 * replace it: the footprint for the base, rods from joint to joint for the rest. Metres; the group's origin
 * is the base frame.
 */

import {
  BufferAttribute,
  BufferGeometry,
  CylinderGeometry,
  ExtrudeGeometry,
  Group,
  Mesh,
  MeshLambertMaterial,
  Shape,
  SphereGeometry,
  URDFLoader,
  Vector3,
} from "../../vendor/scene/library.js";
import { readMesh } from "./meshes.js";

const BASE_M = 0.3; // height of a base without a mesh
const ROD_M = 0.045; // radius of a rod or a ball
const AT_ONCE = 3; // meshes that are read at the same time
const MOST_TRIANGLES = 400_000; // of all meshes
const JOINTS_COME_MS = 3_000;
const AT_REST = 1e-3; // rad or m
const UP = new Vector3(0, 1, 0); // axis of a cylinder

export class RobotModel {
  group = new Group();
  #changed;
  #note;
  #model = null;
  #base = null; // the shape in place of a missing base
  #footprint = null;
  #joints = {};
  #wanted = {};
  #plain = new MeshLambertMaterial(); // of shapes without a colour
  #painted = new MeshLambertMaterial({ vertexColors: true }); // of joined shapes
  #substitute = new MeshLambertMaterial();
  #movable = []; // names of joints that are not fixed and do not mimic another joint
  #lacking = 0; // number of movable joints whose positions are not known
  #saysFromMs = 0; // before this time, unknown positions are not reported: they come after the description
  #notes = [];
  #triangles = 0;
  #abort = new AbortController();

  /** @param {() => void} changed @param {(notes: string[]) => void} note differences from the real robot */
  constructor(changed, note) {
    this.#changed = changed;
    this.#note = note;
  }

  set colours(colours) {
    this.#plain.color.set(colours.arm.colour);
    this.#substitute.color.set(colours["robot-edge"].colour);
  }

  /** @param {number[][]} footprint of the base, metres */
  set footprint(footprint) {
    if (JSON.stringify(footprint) === JSON.stringify(this.#footprint)) return;
    this.#footprint = footprint;
    this.#showBase();
  }

  /** @param {Record<string, number>} joints rad or m */
  set joints(joints) {
    this.#wanted = joints;
    const lacking = this.#movable.filter((name) => !(name in joints)).length;
    if (lacking === this.#lacking || performance.now() < this.#saysFromMs) return;
    this.#lacking = lacking;
    this.#sayNotes();
  }

  joint(name) {
    return this.#model?.joints[name]?.angle ?? null;
  }

  get links() {
    return this.#model ? Object.keys(this.#model.links).length : 0;
  }

  /** The number of meshes and shapes. */
  get size() {
    let count = 0;
    for (const root of [this.#model, this.#base])
      root?.traverse((part) => {
        if (part.isMesh) count += 1;
      });
    return count;
  }

  /**
   * Move the joints by a fraction of the way to their newest positions.
   * @returns {boolean} whether they still move
   */
  glide(fraction) {
    if (!this.#model) return false;
    let moves = false;
    for (const [name, wanted] of Object.entries(this.#wanted)) {
      const joint = this.#model.joints[name];
      if (!joint || joint.mimicJoint) continue;
      const before = this.#joints[name] ?? wanted;
      const isFar = Math.abs(wanted - before) > AT_REST;
      const now = isFar ? before + fraction * (wanted - before) : wanted;
      moves ||= now !== wanted;
      this.#joints[name] = now;
      joint.setJointValue(now);
    }
    return moves;
  }

  /** @param {?object} description as the API gives it; null: there is none */
  async describe(description) {
    this.#abort.abort();
    this.#abort = new AbortController();
    this.#clear();
    this.#notes = [...(description?.problems ?? [])];
    if (description) await this.#build(description, this.#abort.signal);
    this.#showBase();
    this.#sayNotes();
    this.#changed();
  }

  #sayNotes() {
    const text = ngettext(
      "The position of %s joint is not known: it is drawn where it was last.",
      "The positions of %s joints are not known: they are drawn where they were last.",
      this.#lacking,
    );
    const unknown = this.#lacking ? [interpolate(text, [this.#lacking])] : [];
    this.#note([...unknown, ...this.#notes]);
  }

  async #build(description, signal) {
    const jobs = [];
    try {
      const loader = new URDFLoader();
      loader.packages = (name) => `package://${name}`;
      loader.loadMeshCb = (filename, _manager, material, done) =>
        jobs.push({ filename, material, done });
      this.#model = loader.parse(description.urdf);
    } catch (error) {
      this.#model = null;
      this.#notes.push(
        interpolate(gettext("The description could not be drawn: %s"), [error.message]),
      );
      return;
    }
    // The real position is drawn, even outside the limits.
    for (const joint of Object.values(this.#model.joints)) joint.ignoreLimits = true;
    this.#movable = Object.values(this.#model.joints)
      .filter(({ jointType, mimicJoint }) => jointType !== "fixed" && !mimicJoint)
      .map(({ name }) => name);
    this.#saysFromMs = performance.now() + JOINTS_COME_MS;
    this.group.add(this.#model);
    for (const link of Object.values(this.#model.links)) joinShapes(link, this.#painted);
    this.#plainMaterials(this.#model);
    this.#changed();
    const entries = Object.fromEntries(description.meshes.map((mesh) => [mesh.filename, mesh]));
    const found = new Map(); // by address: several links may share a mesh
    const next = async () => {
      for (let job = jobs.shift(); job && !signal.aborted; job = jobs.shift())
        await this.#load(job, entries[job.filename], found, signal);
    };
    await Promise.all(Array.from({ length: AT_ONCE }, next));
    if (!signal.aborted) this.#substitutes();
  }

  async #load({ filename, material, done }, entry, found, signal) {
    if (!entry?.address) {
      this.#once(entry?.problem ?? filename);
      return;
    }
    try {
      if (!found.has(entry.address)) found.set(entry.address, readMesh(entry, signal));
      const { make, triangles } = await found.get(entry.address);
      if (signal.aborted) return;
      if (this.#triangles + triangles > MOST_TRIANGLES)
        throw new Error(
          interpolate(gettext("“%s” is too fine: the robot has more triangles than pages draw."), [
            filename,
          ]),
        );
      this.#triangles += triangles;
      const part = make(this.#lambert(material));
      done(part);
      this.#changed();
    } catch (error) {
      if (!signal.aborted) this.#once(error.message);
    }
  }

  #once(text) {
    if (!this.#notes.includes(text)) this.#notes.push(text);
  }

  /**
   * Replace the loader's materials by cheaper ones, with the page's colour where the description has none.
   */
  #plainMaterials(root) {
    root.traverse((part) => {
      if (part.isMesh) part.material = this.#lambert(part.material);
    });
  }

  #lambert(material) {
    if (material.isMeshLambertMaterial) return material;
    if (isPlain(material)) return this.#plain;
    const { color, opacity, transparent } = material;
    return new MeshLambertMaterial({ color, opacity, transparent });
  }

  // --- shapes in place of missing meshes ------------------------------------------------------------

  #substitutes() {
    for (const link of Object.values(this.#model.links)) {
      const visuals = link.children.filter((child) => child.isURDFVisual);
      const lacks = visuals.some((visual) => visual.children.length === 0);
      if (lacks) this.#addRods(link);
    }
  }

  /** Add a rod from the link's origin to each of its joints; a ball to a link without joints. */
  #addRods(link) {
    const joints = link.children.filter((child) => child.isURDFJoint);
    const ends = joints.map((joint) => joint.position).filter((end) => end.length() > ROD_M);
    for (const end of ends) {
      const rod = new Mesh(new CylinderGeometry(ROD_M, ROD_M, end.length(), 12), this.#substitute);
      rod.position.copy(end).multiplyScalar(0.5);
      rod.quaternion.setFromUnitVectors(UP, end.clone().normalize());
      link.add(rod);
    }
    if (ends.length === 0 && joints.length === 0)
      link.add(new Mesh(new SphereGeometry(ROD_M, 12, 8), this.#substitute));
  }

  /** Show the footprint as the base, if the description has no shape for the base. */
  #showBase() {
    this.#base?.removeFromParent();
    this.#base?.geometry.dispose();
    this.#base = null;
    if (!this.#footprint || this.#hasLowShape) return;
    const outline = new Shape();
    for (const [i, [x, y]] of this.#footprint.entries())
      if (i === 0) outline.moveTo(x, y);
      else outline.lineTo(x, y);
    const body = new ExtrudeGeometry(outline, { depth: BASE_M, bevelEnabled: false });
    this.#base = new Mesh(body, this.#substitute);
    this.group.add(this.#base);
  }

  /** Return whether a shape of the description is as low as the base. */
  get #hasLowShape() {
    if (!this.#model) return false;
    const low = new Vector3();
    let found = false;
    this.#model.updateMatrixWorld(true);
    this.#model.traverse((part) => {
      if (found || !part.isMesh || part.material === this.#substitute) return;
      part.geometry.computeBoundingSphere();
      low.copy(part.geometry.boundingSphere.center).applyMatrix4(part.matrixWorld);
      found = low.z < BASE_M + 0.2;
    });
    return found;
  }

  #clear() {
    this.#triangles = 0;
    this.#movable = [];
    this.#lacking = 0;
    this.#joints = {};
    const ours = [this.#plain, this.#painted, this.#substitute];
    this.#model?.traverse((part) => {
      part.geometry?.dispose();
      for (const material of [part.material ?? []].flat())
        if (!ours.includes(material)) material.dispose();
    });
    this.#model?.removeFromParent();
    this.#model = null;
  }
}

/** Return whether the description gives no colour. */
function isPlain(material) {
  return !material.name && material.color.getHex() === 0xffffff;
}

/** Join the link's opaque, coloured shapes to one part: the fewer parts, the faster a picture is drawn. */
function joinShapes(link, painted) {
  const visuals = link.children.filter(({ isURDFVisual, children: [part] }) => {
    return isURDFVisual && part?.isMesh && !isPlain(part.material) && !part.material.transparent;
  });
  if (visuals.length < 2) return;
  const parts = visuals.map((visual) => {
    const [{ geometry, material, matrix }] = visual.children;
    for (const placed of [visual, ...visual.children]) placed.updateMatrix();
    visual.removeFromParent();
    const { count } = geometry.getAttribute("position");
    const colours = Array.from({ length: count }, () => material.color.toArray()).flat();
    geometry.setAttribute("color", new BufferAttribute(new Float32Array(colours), 3));
    return geometry.applyMatrix4(matrix.premultiply(visual.matrix));
  });
  link.add(new Mesh(joined(parts), painted));
}

function joined(parts) {
  const whole = new BufferGeometry();
  for (const name of ["position", "normal", "color"]) {
    const values = parts.flatMap((part) => [...part.getAttribute(name).array]);
    whole.setAttribute(name, new BufferAttribute(new Float32Array(values), 3));
  }
  let first = 0;
  const corners = parts.flatMap((part) => {
    const begin = first;
    first += part.getAttribute("position").count;
    return [...part.index.array].map((corner) => begin + corner);
  });
  whole.setIndex(corners);
  return whole;
}
