import { expect, it } from "vitest";
import { leftOf, limits } from "../../../static/js/tasks/lesson_tasks.js";

const motions = [{ name: "wave" }, { name: "home" }];
const nameOf = ({ name }) => name;

it("offers what the lesson leaves, and everything where it chooses nothing", () => {
  const tasks = { motions: ["wave", "gone"], phrases: [] };
  expect(leftOf(tasks, "motions", motions, nameOf)).toEqual([{ name: "wave" }]);
  expect(leftOf(tasks, "phrases", motions, nameOf)).toBe(motions);
  expect(leftOf(null, "motions", motions, nameOf)).toBe(motions);
  expect(limits(tasks, "motions")).toBe(true);
  expect(limits({ motions: [] }, "motions")).toBe(false);
});

it("offers nothing of what the lesson is without", () => {
  const tasks = { motions: ["wave"], phrases: [], without: ["motions"] };
  expect(leftOf(tasks, "motions", motions, nameOf)).toEqual([]);
  expect(limits(tasks, "motions")).toBe(true);
  expect(limits(tasks, "phrases")).toBe(false);
});
