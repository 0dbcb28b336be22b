import { describe, expect, it, vi } from "vitest";
import { PublishPanel } from "../../../static/js/topics/publish.js";

const NOTES = { topic: "/demo/notes", type: "std_msgs/String", why: "" };
const DEFINITION = { fields: [{ name: "data", type: "string" }] };
const PARTS = {
  "publish-topic": "select",
  "publish-as": "select",
  "publish-form": "form",
  "publish-none": "p",
  "publish-fields": "div",
  "publish-fault": "p",
};

function panelAt(ask) {
  const parts = Object.fromEntries(
    Object.entries(PARTS).map(([name, tag]) => [name, document.createElement(tag)]),
  );
  return { parts, panel: new PublishPanel(parts, ask) };
}

describe("the form of what may be published", () => {
  it("is there once a connection is, though the topic was offered before", async () => {
    const ask = vi.fn().mockRejectedValueOnce(new Error("There is no connection."));
    ask.mockResolvedValue(DEFINITION);
    const { parts, panel } = panelAt(ask);
    panel.publishable = [NOTES];
    await vi.waitFor(() => expect(parts["publish-fault"].textContent).not.toBe(""));
    panel.connected();
    await vi.waitFor(() => expect(parts["publish-fields"].children).toHaveLength(1));
    expect(parts["publish-fault"].hidden).toBe(true);
    panel.connected(); // again, after a pause of the network: what was written stays
    expect(ask).toHaveBeenCalledTimes(2);
  });
});
