import { beforeEach, describe, expect, it } from "vitest";
import { RobotContact } from "../../../static/js/control/robot_contact.js";

const STATE = { phase: "online", stop: { state: "clear" }, unseen_s: null };

describe("what a page knows of its robot", () => {
  let contact;
  beforeEach(() => {
    contact = new RobotContact();
  });

  it("is out of reach three seconds after the last state", () => {
    expect(contact.isLost(0)).toBe(false); // no state yet
    contact.receive(STATE, 1000);
    expect(contact.isLost(2100)).toBe(false);
    expect(contact.isLost(4100)).toBe(true);
    contact.hide(4000); // a hidden page gets no views
    expect(contact.isLost(4100)).toBe(false);
  });

  it("knows that a hidden page gets no views, until a moment after it is shown again", () => {
    contact.receive(STATE, 1000);
    expect(contact.wasHidden(1500)).toBe(false);
    contact.hide(4000);
    expect(contact.wasHidden(4500)).toBe(true);
    expect(contact.wasHidden(5100)).toBe(false);
    contact.hide(6000);
    contact.receive(STATE, 6100);
    expect(contact.wasHidden(6200)).toBe(false);
  });

  it("is out of reach at once without a bridge, and is back with the next state", () => {
    contact.receive(STATE, 1000);
    contact.lose({ refusal: { text: "No bridge." }, stop: { by: "Ann" }, seen_at: 7 });
    expect(contact.isLost(1000)).toBe(true);
    expect(contact.facts(1500)).toEqual({
      gone: { text: "No bridge." },
      pending: { by: "Ann" },
      seen: 7,
      state: STATE,
      sinceViewMs: 500,
    });
    contact.receive(STATE, 2000);
    expect(contact.isLost(2000)).toBe(false);
    expect(contact.facts(2000).seen).toBe(7); // this state has no `seen_at`
  });

  it("confirms a stop only by a state that came after the press", () => {
    expect(contact.isStoppedSince(0)).toBe(false);
    contact.receive({ ...STATE, stop: { state: "stopping" } }, 1000);
    expect(contact.isStoppedSince(900)).toBe(true);
    expect(contact.isStoppedSince(1000)).toBe(false);
    contact.receive(STATE, 2000);
    expect(contact.isStoppedSince(900)).toBe(false);
  });
});
