import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { firstView, Views } from "../../../static/js/camera/view_choice.js";
import { parts } from "../../../static/js/lib/dom.js";
import * as prefs from "../../../static/js/lib/prefs.js";
import { areaElement } from "./page.js";

const HEAD = { name: "head", label: "Head camera", moves: true };
const WRIST = { name: "wrist", label: "Wrist camera" };

describe("the first view", () => {
  it("shows the camera, and the plan beside it where there is room", () => {
    expect(firstView(null, 716, 760)).toBe("both");
    expect(firstView(null, 348, 256)).toBe("camera");
    expect(firstView(null, 700, 300)).toBe("camera");
  });

  it("is the chosen one", () => {
    expect(firstView("plan", 1000, 1000)).toBe("plan");
    expect(firstView("both", 300, 200)).toBe("both");
    expect(firstView("hologram", 300, 200)).toBe("camera");
  });
});

describe("the views", () => {
  let found;
  let views;
  let changes;
  const press = (view) => found.views.querySelector(`[data-view=${view}]`).click();

  beforeEach(() => {
    for (const name of ["camera-view", "camera-main", "camera-second"]) prefs.remember(name, null);
    found = parts(areaElement());
    views = new Views(found["picture-area"], found);
    changes = vi.fn();
    views.addEventListener("change", changes);
  });

  afterEach(() => views.close());

  it("are plan and 3D for a robot without a camera", () => {
    expect(found["view-bar"].hidden).toBe(true);
    views.cameras = [];
    expect([views.view, views.main, found["view-bar"].hidden]).toEqual(["plan", null, false]);
    const offered = [...found.views.querySelectorAll("[data-view]")].filter((one) => !one.hidden);
    expect(offered.map((one) => one.dataset.view)).toEqual(["plan", "scene"]);
    press("scene");
    expect([views.view, views.main, found.camera.hidden]).toEqual(["scene", null, true]);
  });

  it("show the camera of a robot that has one", () => {
    views.cameras = [HEAD];
    expect([views.view, views.main, views.second]).toEqual(["both", HEAD, null]);
    expect(found["picture-area"].dataset.view).toBe("both");
    expect([found.camera.hidden, found.snapshot.hidden, found["camera-pick"].hidden]).toEqual([
      false,
      false,
      true,
    ]);
    expect(changes).toHaveBeenCalledTimes(1);
  });

  it("are kept, and hold when the robot is edited", () => {
    views.cameras = [HEAD];
    press("plan");
    expect([views.main, found.camera.hidden]).toEqual([null, true]);
    views.cameras = [HEAD, WRIST];
    expect(views.view).toBe("plan");
    const next = new Views(found["picture-area"], found);
    delete found["picture-area"].dataset.cameras;
    next.cameras = [HEAD];
    expect(next.view).toBe("plan");
    next.close();
  });

  it("switch between cameras, one small beside the other", () => {
    views.cameras = [HEAD, WRIST];
    expect(found["camera-pick"].hidden).toBe(false);
    expect([...found["camera-select"].options].map(({ text }) => text)).toEqual([
      "Head camera",
      "Wrist camera",
    ]);
    found["second-toggle"].click();
    expect([views.main, views.second, found.second.hidden]).toEqual([HEAD, WRIST, false]);
    found["second-swap"].click();
    expect([views.main, views.second]).toEqual([WRIST, HEAD]);
    found["camera-select"].value = "head";
    found["camera-select"].dispatchEvent(new Event("change"));
    expect([views.main, views.second]).toEqual([HEAD, WRIST]);
    found["second-toggle"].click();
    expect(views.second).toBe(null);
  });

  it("swap the camera with the small plan, and back", () => {
    views.cameras = [HEAD];
    found["plan-swap"].click();
    expect([views.view, views.main, views.second]).toEqual(["plan", null, HEAD]);
    found["second-swap"].click();
    expect([views.view, views.main, views.second]).toEqual(["camera", HEAD, null]);
  });

  it("are those of the own layout, until another view is chosen or the layout ends", () => {
    views.cameras = [HEAD, WRIST];
    expect(found.views.querySelector("[data-view=own]").hidden).toBe(true);
    views.cells = ["camera", "second", "map"];
    expect([views.view, views.main, views.second]).toEqual(["own", HEAD, WRIST]);
    expect([views.shows("map"), views.shows("plan"), views.shows("scene")]).toEqual([
      true,
      false,
      false,
    ]);
    expect([found.camera.dataset.cell, found.second.dataset.cell, found.map.dataset.cell]).toEqual([
      "a",
      "b",
      "c",
    ]);
    press("plan");
    expect([views.view, views.shows("map"), found.map.dataset.cell]).toEqual([
      "plan",
      false,
      undefined,
    ]);
    press("own");
    expect(views.view).toBe("own");
    views.cells = null;
    expect([views.view, found["picture-area"].dataset.cells]).toEqual(["plan", undefined]);
  });

  it("opens the bar of a small screen until a press elsewhere", () => {
    views.cameras = [HEAD];
    found["view-open"].click();
    expect(found["view-bar"].dataset.open).toBe("true");
    found.snapshot.dispatchEvent(new Event("pointerdown", { bubbles: true }));
    expect(found["view-bar"].dataset.open).toBe("true");
    document.body.dispatchEvent(new Event("pointerdown", { bubbles: true }));
    expect(found["view-bar"].dataset.open).toBe(undefined);
    found["view-open"].click();
    press("camera");
    expect(found["view-bar"].dataset.open).toBe(undefined);
    found["view-open"].click();
    found["full-screen"].click(); // on the whole screen nothing may cover the picture
    expect(found["view-bar"].dataset.open).toBe(undefined);
  });
});
