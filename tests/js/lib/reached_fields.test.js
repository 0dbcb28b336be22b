import { expect, test, vi } from "vitest";

/** Show a form with this field, choose a profile, and return whether the form was sent with `_reached`. */
async function asks(field, profile) {
  vi.resetModules();
  document.body.innerHTML = `<form><select name="profile" data-ros2="3 5">
    <option value=""></option><option value="1"></option><option value="3"></option><option value="5"></option>
    </select><input name="${field}"></form>`;
  const form = document.querySelector("form");
  form.submit = vi.fn();
  await import("../../../static/js/lib/reached_fields.js");
  const select = form.querySelector("select");
  select.value = profile;
  select.dispatchEvent(new Event("change"));
  expect(form.submit.mock.calls.length).toBe(form.querySelectorAll("[name=_reached]").length);
  return form.submit.mock.calls.length === 1;
}

test.each([
  ["master_uri", "3", true],
  ["master_uri", "1", false],
  ["domain_id", "5", false],
  ["domain_id", "1", true],
])("a form with %s asks again after the choice of profile %s: %s", async (field, profile, sent) => {
  expect(await asks(field, profile)).toBe(sent);
});
