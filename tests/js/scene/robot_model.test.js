import { expect, it } from "vitest";
import { RobotModel } from "../../../static/js/scene/robot_model.js";

const shape = (x, size, colour = "") =>
  `<visual><origin xyz="${x} 0 0"/><geometry><box size="${size}"/></geometry>${colour}</visual>`;
const paint = (rgba) => `<material name="${rgba}"><color rgba="${rgba}"/></material>`;

it("joins the opaque shapes of a link that have colours, each in its place and colour", async () => {
  const visuals =
    shape(1, "0.5 1 2", paint("1 0 0 1")) +
    shape(-2, "2 1 1", paint("0 0 1 1")) +
    shape(0, "1 1 1", paint("0 1 0 0.5")) +
    shape(0, "1 1 1");
  const robot = new RobotModel(
    () => {},
    () => {},
  );
  await robot.describe({
    urdf: `<robot name="r"><link name="base">${visuals}</link></robot>`,
    meshes: [],
    problems: [],
  });
  expect(robot.size).toBe(3); // the two joined ones, the transparent one, the one in the page's colour
  const parts = [];
  robot.group.traverse((part) => part.isMesh && parts.push(part));
  const { geometry, material } = parts.find((part) => part.geometry.hasAttribute("color"));
  expect(material.vertexColors).toBe(true);
  geometry.computeBoundingBox();
  expect(geometry.boundingBox.min.toArray()).toEqual([-3, -0.5, -1]);
  expect(geometry.boundingBox.max.toArray()).toEqual([1.25, 0.5, 1]);
  expect(geometry.index.count).toBe(2 * 36);
  expect(Math.max(...geometry.index.array)).toBe(2 * 24 - 1);
  expect([...geometry.getAttribute("color").array.slice(0, 3)]).toEqual([1, 0, 0]);
  expect([...geometry.getAttribute("color").array.slice(-3)]).toEqual([0, 0, 1]);
});
