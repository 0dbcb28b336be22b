import { describe, expect, it, vi } from "vitest";
import { dictionary, PublishPanel } from "../../../static/js/topics/publish.js";

const NOTES = { topic: "/demo/notes", type: "std_msgs/String", why: "" };
const DEFINITION = { fields: [{ name: "data", type: "string" }] };
const PARTS = {
  "publish-topic": "select",
  "publish-as": "select",
  "publish-form": "form",
  "publish-none": "p",
  "publish-fields": "div",
  "publish-fault": "p",
  "publish-rate": "input",
};

function panelAt(ask) {
  const parts = Object.fromEntries(
    Object.entries(PARTS).map(([name, tag]) => [name, document.createElement(tag)]),
  );
  parts["publish-as"].innerHTML = "<option value=form>A form</option>";
  return { parts, panel: new PublishPanel(parts, ask) };
}

describe("the publishing form", () => {
  it("appears with the connection, for a topic offered before", async () => {
    const ask = vi.fn().mockRejectedValueOnce(new Error("There is no connection."));
    ask.mockResolvedValue(DEFINITION);
    const { parts, panel } = panelAt(ask);
    panel.publishable = [NOTES];
    await vi.waitFor(() => expect(parts["publish-fault"].textContent).not.toBe(""));
    panel.connected();
    await vi.waitFor(() => expect(parts["publish-fields"].children).toHaveLength(1));
    expect(parts["publish-fault"].hidden).toBe(true);
    panel.connected(); // connected again after a network failure: the written values stay
    expect(ask).toHaveBeenCalledTimes(2);
  });

  it("shows a wrong field below the text, other faults as notices", async () => {
    const { parts, panel } = panelAt(vi.fn().mockResolvedValue(DEFINITION));
    panel.publishable = [NOTES];
    await vi.waitFor(() => expect(parts["publish-fields"].children).toHaveLength(1));
    panel.fault({ code: "bad_field", text: "data: a text.", figures: { path: "data" } });
    expect(parts["publish-fields"].querySelector(".field-note").textContent).toBe("data: a text.");
    expect(parts["publish-fault"].textContent).toBe("");
    parts["publish-as"].innerHTML = "<option value=text>A dictionary</option>";
    panel.fault({ code: "no_lease", text: "No control." });
    expect(parts["publish-fault"].textContent).toBe("");
    panel.fault({ code: "bad_field", text: "data: a text.", figures: { path: "data" } });
    expect(parts["publish-fault"].textContent).toBe("data: a text.");
  });

  it("is replaced when the same topic gets another type", async () => {
    const ask = vi.fn().mockResolvedValue(DEFINITION);
    const { panel } = panelAt(ask);
    panel.publishable = [NOTES];
    panel.publishable = [NOTES];
    panel.publishable = [{ ...NOTES, type: "std_msgs/Bool" }];
    expect(ask.mock.calls.map(([, type]) => type)).toEqual(["std_msgs/String", "std_msgs/Bool"]);
  });

  it.each([
    ["", 0],
    ["0", 0],
    ["0.1", 0.1],
    ["50", 50],
    ["0.05", null],
    ["-1", null],
    ["51", null],
    ["often", null],
  ])("takes the rate %s for %s", async (written, rateHz) => {
    const { parts, panel } = panelAt(vi.fn().mockResolvedValue(DEFINITION));
    const rates = [];
    panel.addEventListener("publish", ({ detail }) => rates.push(detail.rate_hz));
    panel.publishable = [NOTES];
    await vi.waitFor(() => expect(parts["publish-fields"].children).toHaveLength(1));
    parts["publish-rate"].value = written;
    parts["publish-form"].dispatchEvent(new Event("submit"));
    expect(rates).toEqual(rateHz === null ? [] : [rateHz]);
    expect(parts["publish-rate"].getAttribute("aria-invalid")).toBe(String(rateHz === null));
  });
});

describe("a dictionary", () => {
  it("keeps all digits of a whole number", () => {
    const text = '{"a":18446744073709551615,"b":[1,-9223372036854775808],"c":1e+300,"d":0.5}';
    expect(JSON.stringify(dictionary(text))).toBe(text);
  });

  it.each(["[1]", "5", "9007199254740993", "null", '"text"', "{", "{'a': 1}"])(
    "is not %s",
    (text) => {
      expect(() => dictionary(text)).toThrow("Write a dictionary");
    },
  );
});
