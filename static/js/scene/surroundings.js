/**
 * The surroundings of the robot: points of the laser and the depth camera, remembered obstacles, the obstacle
 * for which the gate slows the robot, and the robot's path; on the floor the map and navigation's path.
 * `local` is in the base frame, `world` in the frame of the map. Metres.
 */

import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DirectionalLight,
  DynamicDrawUsage,
  Group,
  HemisphereLight,
  Line,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  NearestFilter,
  PlaneGeometry,
  Points,
  PointsMaterial,
  RingGeometry,
  SRGBColorSpace,
  Texture,
} from "../../vendor/scene/library.js";
import { arc, moves, reach } from "../drive/twist_geometry.js";

const MOST_POINTS = 60_000;
const POINT_M = 0.045;
const LASER_CM = 10; // typical height of a laser
const LASER_M = LASER_CM / 100;
const COLUMN_CM = 8; // between two points of a column that the depth camera saw
const PATH_S = 2;
const PATH_STEPS = 24;
const GRID_M = 10;
const POST_M = 1.0; // height of the mark at the obstacle for which the gate slows the robot
const ON_FLOOR = { map: 0.001, way: 0.02, path: 0.03 };

/** Many lines or points whose number changes. */
class Buffer {
  geometry = new BufferGeometry();
  #places;
  #colours;

  constructor(most, coloured = false) {
    this.#places = new BufferAttribute(new Float32Array(3 * most), 3).setUsage(DynamicDrawUsage);
    this.geometry.setAttribute("position", this.#places);
    if (coloured) {
      this.#colours = new BufferAttribute(new Uint8Array(3 * most), 3, true);
      this.geometry.setAttribute("color", this.#colours.setUsage(DynamicDrawUsage));
    }
    this.geometry.setDrawRange(0, 0);
  }

  get most() {
    return this.#places.count;
  }

  /** @param {(put: (x: number, y: number, z: number, colour?: number[]) => void) => void} write */
  fill(write) {
    let count = 0;
    write((x, y, z, colour) => {
      if (count === this.most) return;
      this.#places.setXYZ(count, x, y, z);
      this.#colours?.array.set(colour, 3 * count);
      count += 1;
    });
    for (const attribute of [this.#places, this.#colours]) {
      if (!attribute) continue;
      attribute.clearUpdateRanges();
      attribute.addUpdateRange(0, 3 * count);
      attribute.needsUpdate = count > 0;
    }
    this.geometry.setDrawRange(0, count);
    return count;
  }
}

export class Surroundings {
  world = new Group();
  local = new Group();
  count = 0; // points that are drawn
  #points = new Buffer(MOST_POINTS, true);
  #way = new Buffer(PATH_STEPS + 1);
  #hold = new Buffer(4);
  #path = new Buffer(512);
  #wayLine;
  #holdLine;
  #holdRing;
  #pathLine;
  #grid;
  #map = null;
  #colours = null;
  #footprint = null;
  #scan = null;
  #verdict = null;
  #inMap = false;
  #extra = [];

  constructor() {
    const cloud = new Points(
      this.#points.geometry,
      new PointsMaterial({ size: POINT_M, vertexColors: true }),
    );
    this.#wayLine = new Line(this.#way.geometry, new LineBasicMaterial());
    this.#holdLine = new LineSegments(this.#hold.geometry, new LineBasicMaterial());
    this.#holdRing = new Mesh(new RingGeometry(0.09, 0.13, 24), new MeshBasicMaterial());
    this.#holdRing.visible = false;
    this.#pathLine = new Line(this.#path.geometry, new LineBasicMaterial());
    this.#grid = new LineSegments(gridLines(), new LineBasicMaterial());
    const sun = new DirectionalLight(0xffffff, 1.6);
    sun.position.set(-2, -3, 5);
    this.local.add(cloud, this.#wayLine, this.#holdLine, this.#holdRing, this.#grid);
    this.world.add(this.#pathLine, sun, new HemisphereLight(0xffffff, 0x9a9a9a, 1.8));
    for (const part of [cloud, this.#wayLine, this.#holdLine, this.#pathLine])
      part.frustumCulled = false; // their positions change
  }

  set colours(colours) {
    this.#colours = colours;
    const paint = (part, name) => part.material.color.set(colours[name].colour);
    paint(this.#wayLine, "path");
    paint(this.#pathLine, "path");
    paint(this.#holdLine, "hold");
    paint(this.#holdRing, "hold");
    paint(this.#grid, "grid");
    this.#draw();
  }

  set footprint(footprint) {
    this.#footprint = footprint;
  }

  /**
   * @param {?object} scan
   * @param {object} verdict of the gate
   * @param {boolean} inMap whether the robot knows its pose on the map
   */
  show(scan, verdict, inMap) {
    this.#scan = scan;
    this.#verdict = verdict;
    this.#inMap = inMap;
    this.#draw();
  }

  /** @param {number[]} flatCm navigation's path on the map */
  set path(flatCm) {
    this.#path.fill((put) => {
      for (let i = 0; i < flatCm.length; i += 2)
        put(flatCm[i] / 100, flatCm[i + 1] / 100, ON_FLOOR.path);
    });
  }

  showMap(map, picture) {
    if (this.#map) {
      this.#map.removeFromParent();
      this.#map.geometry.dispose();
      this.#map.material.map.dispose();
      this.#map.material.dispose();
    }
    const [width, height] = [map.width * map.resolution_m, map.height * map.resolution_m];
    const texture = new Texture(picture);
    texture.colorSpace = SRGBColorSpace;
    texture.magFilter = NearestFilter;
    texture.needsUpdate = true;
    const floor = new Mesh(
      new PlaneGeometry(width, height),
      new MeshBasicMaterial({ map: texture, transparent: true, depthWrite: false }),
    );
    const [c, s] = [Math.cos(map.origin_rad), Math.sin(map.origin_rad)];
    floor.position.set(
      map.origin_x_m + (c * width - s * height) / 2,
      map.origin_y_m + (s * width + c * height) / 2,
      ON_FLOOR.map,
    );
    floor.rotation.z = map.origin_rad;
    floor.visible = this.#inMap;
    this.#map = floor;
    this.world.add(floor);
  }

  /** Whether the obstacle for which the gate slows the robot is drawn. */
  get holds() {
    return this.#holdRing.visible;
  }

  get hasMap() {
    return Boolean(this.#map?.visible);
  }

  /** For benchmarks: show this number of points around the robot. */
  fill(points) {
    this.#extra = Array.from({ length: points }, (_, i) => {
      const angle = i * 2.399963;
      const away = 0.5 + (7.5 * i) / points;
      return [away * Math.cos(angle), away * Math.sin(angle), (i % 100) / 50];
    });
    this.#draw();
  }

  #draw() {
    if (!this.#colours) return;
    this.#drawPoints();
    this.#drawWay();
    this.#drawHold();
    if (this.#map) this.#map.visible = this.#inMap;
    this.#pathLine.visible = this.#inMap;
  }

  #drawPoints() {
    const { laser_cm = [], depth_cm = [], remembered_cm = [], heights_cm = [] } = this.#scan ?? {};
    this.count = this.#points.fill((put) => {
      const flat = (cm, name, heights = []) => {
        const colour = bytesOf(this.#colours[name].colour);
        for (let i = 0; i < cm.length; i += 2) {
          const [low, high] = [heights[i] ?? LASER_CM, heights[i + 1] ?? LASER_CM];
          for (let z = low; z <= Math.max(low, high); z += COLUMN_CM)
            put(cm[i] / 100, cm[i + 1] / 100, z / 100, colour);
        }
      };
      flat(remembered_cm, "remembered");
      flat(depth_cm, "depth", heights_cm);
      flat(laser_cm, "laser");
      const extra = bytesOf(this.#colours.depth.colour);
      for (const [x, y, z] of this.#extra) put(x, y, z, extra);
    });
  }

  #drawWay() {
    const allowed = this.#verdict?.allowed ?? [0, 0, 0];
    const [vx, vy, w] = allowed;
    this.#way.fill((put) => {
      if (!moves(allowed)) return;
      put(0, 0, ON_FLOOR.way);
      for (const { x, y } of arc({ vx, vy, w }, PATH_S, PATH_STEPS)) put(x, y, ON_FLOOR.way);
    });
  }

  /**
   * Draw a line from the robot to the obstacle, a ring around it, and a post that is visible from the side.
   */
  #drawHold() {
    const point = this.#verdict?.point ?? null;
    this.#holdRing.visible = point !== null;
    this.#hold.fill((put) => {
      if (!point) return;
      const [x, y] = point;
      const fraction = Math.min(
        (this.#footprint ? reach(this.#footprint) : 0) / Math.hypot(x, y),
        1,
      );
      put(fraction * x, fraction * y, LASER_M);
      put(x, y, LASER_M);
      put(x, y, 0);
      put(x, y, POST_M);
      this.#holdRing.position.set(x, y, LASER_M);
    });
  }
}

/** Return a colour of the page as bytes in the renderer's colour space, which is linear. */
function bytesOf(colour) {
  return new Color(colour).toArray().map((part) => Math.round(255 * part));
}

function gridLines() {
  const places = [];
  for (let at = -GRID_M; at <= GRID_M; at += 1)
    places.push(-GRID_M, at, 0, GRID_M, at, 0, at, -GRID_M, 0, at, GRID_M, 0);
  return new BufferGeometry().setAttribute(
    "position",
    new BufferAttribute(new Float32Array(places), 3),
  );
}
