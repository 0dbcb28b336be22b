import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { GoingPanel } from "../../../static/js/going/going_panel.js";
import { parts } from "../../../static/js/lib/dom.js";

const FACTS = {
  footprint: [
    [0.3, 0.2],
    [-0.3, 0.2],
    [-0.3, -0.2],
    [0.3, -0.2],
  ],
  front_margin_m: 0.1,
  lateral_margin_m: 0,
};
const LEFT = { point: [0, 2] };

describe("a point to which the robot may drive", () => {
  let panel;
  let page;
  let request;
  let notify;
  let ghost;
  let base;
  let ended;
  let clock;

  beforeEach(() => {
    document.body.innerHTML = `<div data-part="there-offer" hidden><p data-part="there-words"></p>
      <button data-part="there-look"></button><button data-part="there-go"></button>
      <button data-part="there-close"></button></div>`;
    page = parts(document);
    request = vi.fn(() => Promise.resolve(null));
    notify = vi.fn();
    clock = vi.spyOn(performance, "now").mockReturnValue(1000);
    panel = new GoingPanel({
      parts: page,
      request,
      notify,
      tell: (news) => {
        ghost = news.ghost;
      },
    });
    panel.facts = FACTS;
    panel.mayAct = true;
    base = { x: 0, y: 0, yaw: 0 };
    ended = { number: 4, outcome: "done", text: "" };
    see();
  });

  afterEach(() => {
    panel.close();
    vi.restoreAllMocks();
  });

  /** Take a view of the robot: where it stands, and what it drives. */
  function see({ laser_cm = [], now = null } = {}) {
    panel.view = { state: { odometry: base }, scan: { laser_cm } };
    panel.drive_by = { now, ended };
  }

  function point(pointed = LEFT) {
    panel.pointed = pointed;
    clock.mockReturnValue(performance.now() + 1000);
  }

  /** The robot accepts what was asked last, drives it and ends it. */
  async function drives(outcome = "done", text = "") {
    await Promise.resolve();
    see({ now: { who: "Ann" } });
    ended = { number: ended.number + 1, fence: 1, seq: 1, outcome, text };
    see();
  }

  const asked = () => request.mock.calls.map(([{ title: _, ...sent }]) => sent);

  it("shows a ghost there, and moves nothing by the press", () => {
    point();
    expect(ghost.ghost[0]).toEqual([expect.closeTo(-0.2), expect.closeTo(2.3)]);
    expect([page["there-offer"].hidden, page["there-words"].textContent]).toEqual([
      false,
      "2.0 m away",
    ]);
    expect(request).not.toHaveBeenCalled();
    base = { x: 0, y: 1, yaw: 0 };
    see();
    expect(page["there-words"].textContent).toBe("1.0 m away"); // the ghost stays at its place
  });

  it("has the focus after keys chose the point, and gives it back", () => {
    const from = document.body.appendChild(document.createElement("button"));
    point({ ...LEFT, from });
    expect(document.activeElement).toBe(page["there-go"]);
    page["there-close"].click();
    expect(document.activeElement).toBe(from);
  });

  it("takes no double press for a press of the button", () => {
    panel.pointed = LEFT;
    page["there-go"].click();
    expect(request).not.toHaveBeenCalled();
  });

  it("drives there by two requests, the second by where the robot stands after the first", async () => {
    point();
    page["there-go"].click();
    expect(asked()).toEqual([{ t: "drive_by", angle_rad: Math.PI / 2 }]);
    expect(page["there-offer"].hidden).toBe(true);
    see(); // a view from before the turn
    base = { x: 0, y: 0.1, yaw: Math.PI / 2 };
    await drives();
    expect(asked()[1]).toEqual({ t: "drive_by", distance_m: expect.closeTo(1.9) });
    expect(ghost).not.toBe(null);
    await drives();
    expect(request).toHaveBeenCalledTimes(2);
    expect(notify).toHaveBeenCalledExactlyOnceWith(
      expect.objectContaining({ level: "success", text: "The robot is there." }),
    );
    expect(ghost).toBe(null);
  });

  it.each(["replaced", "stopped", "held_back", "control_lost", "cancelled"])(
    "sends nothing more after a turn that ended %s",
    async (outcome) => {
      point();
      page["there-go"].click();
      await drives(outcome, "Why.");
      expect(request).toHaveBeenCalledTimes(1);
      expect(notify).toHaveBeenCalledTimes(["replaced", "cancelled"].includes(outcome) ? 1 : 0); // else: `DriveBy`
      expect(ghost).toBe(null);
    },
  );

  it("sends nothing more after a refused turn, or when something is in the way by then", async () => {
    request.mockResolvedValueOnce({ code: "base_moving", text: "" });
    point();
    page["there-go"].click();
    await vi.waitFor(() => expect(ghost).toBe(null));
    point();
    page["there-go"].click();
    await Promise.resolve();
    base = { x: 0, y: 0, yaw: Math.PI / 2 };
    see({ now: {} });
    ended = { number: 5, outcome: "done", text: "" };
    see({ laser_cm: [100, 0] });
    expect(asked().map(({ distance_m }) => distance_m)).toEqual([undefined, undefined]);
    expect(notify).toHaveBeenLastCalledWith(
      expect.objectContaining({ text: "Blocked after 0.6 m" }),
    );
  });

  it.each([
    ["Escape", () => document.dispatchEvent(new KeyboardEvent("keydown", { key: "Escape" }))],
    ["its cross", () => page["there-close"].click()],
    ["a press on it", () => point({ point: [0.1, 1.9] })],
    ["another tab", () => (panel.tab = "topics")],
    ["a stop", () => panel.zero()],
  ])("is gone after %s", (_, act) => {
    point();
    act();
    expect([ghost, page["there-offer"].hidden]).toEqual([null, true]);
    expect(request).not.toHaveBeenCalled();
  });

  it("waits while the world is silent, but a drive ends", async () => {
    point();
    panel.mayAct = false;
    panel.stale = true;
    expect([ghost === null, page["there-offer"].hidden]).toEqual([false, false]);
    page["there-go"].click();
    expect(request).not.toHaveBeenCalled();
    panel.stale = false;
    panel.mayAct = true;
    page["there-go"].click();
    panel.stale = true;
    expect(ghost).toBe(null);
    expect(asked().at(-1)).toEqual({ t: "drive_by_cancel" });
  });

  it("ends the drive with the ghost, and never sends its second part", async () => {
    point();
    page["there-go"].click();
    await Promise.resolve();
    point(null); // looks around by a press
    expect(ghost).not.toBe(null);
    document.dispatchEvent(new KeyboardEvent("keydown", { key: "Escape" }));
    expect(asked()[1]).toEqual({ t: "drive_by_cancel" });
    await drives();
    expect(request).toHaveBeenCalledTimes(2);
  });

  it.each([
    ["without control", () => (panel.mayAct = false), LEFT, "Take control first."],
    ["behind a wall", () => see({ laser_cm: [100, 0] }), { point: [2, 0] }, "Blocked after 0.6 m"],
  ])("is offered dimmed %s, with the reason", (_, before, pointed, why) => {
    before();
    point(pointed);
    page["there-go"].click();
    expect(page["there-go"].getAttribute("aria-disabled")).toBe("true");
    expect(page["there-go"].title).toBe(why);
    expect(notify).toHaveBeenCalledWith(expect.objectContaining({ text: why }));
    expect(request).not.toHaveBeenCalled();
  });

  it("lets the head look there, where a camera tells how", () => {
    point();
    expect(page["there-look"].hidden).toBe(true);
    const look = vi.fn();
    point({ point: [1, 1], look });
    base = { x: 0, y: 0, yaw: Math.PI / 2 };
    see();
    page["there-look"].click();
    expect(look).toHaveBeenCalledWith([expect.closeTo(1), expect.closeTo(-1)]);
  });
});
