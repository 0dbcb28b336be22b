import { expect, test } from "vitest";
import { isAtLeast, whyNot } from "../../../static/js/control/roles.js";

test("each role has the rights of those before it", () => {
  expect(isAtLeast("operator", "operator")).toBe(true);
  expect(isAtLeast("staff", "operator")).toBe(true);
  expect(isAtLeast("operator", "supervisor")).toBe(false);
});

test("a missing right names the roles that have it", () => {
  expect(whyNot("observer", "operator")).toBe("for operators");
  expect(whyNot("operator", "supervisor")).toBe("for supervisors");
  expect(whyNot("supervisor", "staff")).toBe("for staff");
  expect(whyNot("supervisor", "supervisor")).toBe("");
});
