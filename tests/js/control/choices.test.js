import { beforeEach, describe, expect, it, vi } from "vitest";
import { Choices } from "../../../static/js/control/choices.js";

const PLACES = { chart: "top", motions: "left", phrases: "bottom" };

describe("choices about the control page", () => {
  let sent;
  beforeEach(() => {
    sent = [];
    document.body.innerHTML = '<input name="csrfmiddlewaretoken" value="secret">';
    vi.stubGlobal("fetch", (address, { headers, body }) => {
      sent.push([address, headers["X-CSRFToken"], String(body)]);
      return Promise.reject(new Error("offline"));
    });
  });

  it("are those of the account, before the browser's copy", () => {
    new Choices({ person: "cy" }).remember("panels", PLACES);
    const other = { ...PLACES, chart: "left", motions: "top" };
    const choices = JSON.stringify({ panels: other });
    expect(new Choices({ person: "cy" }).recall("panels", null)).toEqual(PLACES);
    expect(new Choices({ person: "cy", choices }).recall("panels", null)).toEqual(other);
    expect(new Choices({ person: "di" }).recall("panels", null)).toBe(null);
  });

  it("are sent to the console", () => {
    const choices = new Choices({ person: "ed", choicesKeep: "/keep/" });
    choices.remember("panels", PLACES);
    choices.remember("hints_seen", true);
    expect(sent).toEqual([
      ["/keep/", "secret", "chart=top&motions=left&phrases=bottom"],
      ["/keep/", "secret", "hints_seen=true"],
    ]);
    expect(choices.recall("hints_seen", false)).toBe(true);
  });
});
