import { describe, expect, it, vi } from "vitest";
import { ParameterView, ServiceCall } from "../../../static/js/topics/services.js";

const refused = (text, path) => Object.assign(new Error(text), { refusal: { figures: { path } } });

async function pressed(element, name) {
  const button = [...element.querySelectorAll("button")].find((b) => b.textContent === name);
  button.form.dispatchEvent(new Event("submit"));
  await vi.waitFor(() => expect(button.disabled).toBe(false));
}

describe("a parameter", () => {
  async function shown(ask, maySet = true) {
    const view = new ParameterView({ ask }, "/volume", maySet).element;
    await vi.waitFor(() => expect(view.querySelector("textarea").value).toBe("50"));
    return {
      view,
      value: view.querySelector("textarea"),
      said: view.querySelector("[role=alert]"),
    };
  }

  it("is set, and the robot's new value is shown", async () => {
    const ask = vi.fn().mockResolvedValueOnce({ value: 50 }).mockResolvedValueOnce({ value: 60 });
    const { view, value, said } = await shown(ask);
    expect(said.hidden).toBe(true);
    value.value = "60";
    await pressed(view, "Set");
    expect(ask.mock.lastCall).toEqual([{ t: "set_parameter", name: "/volume", value: 60 }]);
    expect([said.textContent, said.dataset.fault, said.hidden]).toEqual(["Set.", undefined, false]);
  });

  it.each([
    ["loud", "Write a value as JSON"],
    ["70", "it is not on the allow-list"],
  ])("that is not set, for %s, says why", async (written, words) => {
    const ask = vi.fn().mockResolvedValueOnce({ value: 50 });
    ask.mockRejectedValue(refused("it is not on the allow-list"));
    const { view, value, said } = await shown(ask);
    value.value = written;
    await pressed(view, "Set");
    expect(said.textContent).toContain(words);
    expect(said.dataset.fault).toBe("true");
    expect(value.value).toBe(written);
  });

  it("is read-only until its value has come, which would replace what was typed", async () => {
    let answer;
    const ask = vi.fn(() => new Promise((resolve) => (answer = resolve)));
    const view = new ParameterView({ ask }, "/volume", true).element;
    const value = view.querySelector("textarea");
    expect(value.readOnly).toBe(true);
    answer({ value: 50 });
    await vi.waitFor(() => expect(value.readOnly).toBe(false));
    expect(value.value).toBe("50");
  });

  it("is read-only for roles that may not set it", async () => {
    const { view, value } = await shown(vi.fn().mockResolvedValue({ value: 50 }), false);
    expect(value.readOnly).toBe(true);
    expect(view.querySelector("button").hidden).toBe(true);
  });
});

describe("a service", () => {
  const DESCRIBED = { type: "std_srvs/SetBoolRequest", fields: [{ name: "data", type: "bool" }] };

  async function opened(ask) {
    const view = new ServiceCall({ ask }, "/lamp", true).element;
    await vi.waitFor(() => expect(view.querySelector("input")).not.toBe(null));
    return view;
  }

  it.each([
    ["std_srvs/SetBoolRequest", "std_srvs/SetBool"],
    ["std_srvs/srv/SetBool_Request", "std_srvs/srv/SetBool"], // ROS 2
  ])("is called with its form, and shows its answer: %s", async (type, name) => {
    const ask = vi.fn().mockResolvedValueOnce({ ...DESCRIBED, type });
    ask.mockResolvedValueOnce({ fields: { success: true } });
    const view = await opened(ask);
    expect(view.querySelector("h3").textContent).toBe(`/lamp ${name}`); // the type comes from the allow-list
    view.querySelector("input").checked = true;
    await pressed(view, "Call");
    expect(ask.mock.lastCall[0]).toMatchObject({
      t: "call",
      service: "/lamp",
      fields: { data: true },
    });
    expect(view.querySelector(".answer").textContent).toContain('"success": true');
  });

  it("says when its answer is shown in part", async () => {
    const ask = vi.fn().mockResolvedValueOnce(DESCRIBED);
    ask.mockResolvedValueOnce({ fields: { cells: [1, 2] }, shortened: { cells: 1000 } });
    const view = await opened(ask);
    await pressed(view, "Call");
    expect(view.querySelector(".answer").textContent).toContain("Shown in part: cells (1000)");
  });

  it("shows a refusal and the place of a wrong field", async () => {
    const ask = vi.fn().mockResolvedValueOnce(DESCRIBED);
    ask.mockRejectedValueOnce(refused("/lamp said no"));
    ask.mockRejectedValueOnce(refused("data: true or false", "data"));
    const view = await opened(ask);
    const answer = view.querySelector(".answer");
    await pressed(view, "Call");
    expect([answer.textContent, answer.dataset.fault]).toEqual(["/lamp said no", "true"]);
    await pressed(view, "Call");
    expect(answer.hidden).toBe(true);
    expect(view.querySelector(".field-note").textContent).toBe("data: true or false");
  });
});
