import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { parts } from "../../../static/js/lib/dom.js";
import { ScenePanel } from "../../../static/js/scene/scene_panel.js";

const PAGE = `<section data-part="scene" data-scene-module="/scene.js" data-help="Help" hidden>
  <div data-part="scene-place"></div>
  <div data-part="scene-modes"><button data-mode="orbit"></button><button data-mode="top"></button></div>
  <details data-part="scene-more" hidden><summary></summary><ul data-part="scene-notes"></ul></details>
  <p data-part="scene-words" hidden></p></section>`;
const ROBOT = "/api/v1/robots/tiago-1";
const DESCRIPTION = { digest: "a", urdf: "<robot/>", meshes: [], problems: [] };
const view = (location = null) => ({ state: { location }, scan: null });

class FakeScene extends EventTarget {
  static made = [];
  static draws = true;
  draws = FakeScene.draws;
  words = "No WebGL.";
  mode = "orbit";
  describe = vi.fn();
  showMap = vi.fn();
  close = vi.fn();
  begin = () => this.draws;
  constructor() {
    super();
    FakeScene.made.push(this);
  }
}

let found;
let panel;
let sent;
let load;
let answers;
let asked; // requests for the description

beforeEach(() => {
  document.body.innerHTML = PAGE;
  found = parts(document);
  FakeScene.made = [];
  FakeScene.draws = true;
  sent = [];
  answers = { "/description": [200, DESCRIPTION], "/map": [404, {}] };
  asked = [];
  vi.stubGlobal("fetch", async (address, { headers = {} }) => {
    const [status, body] = answers[address.replace(ROBOT, "")];
    const tag = `"${body.digest}"`;
    const isKnown = headers["If-None-Match"] === tag;
    if (address.endsWith("/description")) asked.push({ isKnown, ...headers });
    return {
      ok: status === 200 && !isKnown,
      status: isKnown ? 304 : status,
      headers: new Headers(status === 200 ? { ETag: tag } : {}),
      json: async () => (isKnown ? Promise.reject(new SyntaxError("no body")) : body),
    };
  });
  load = vi.fn(async () => ({ SceneView: FakeScene }));
  const root = { dataset: { robot: "tiago-1" } };
  panel = new ScenePanel({ root, parts: found, send: (message) => sent.push(message) }, load);
});

afterEach(() => {
  panel.close();
  vi.unstubAllGlobals();
});

const until = (check) => vi.waitFor(check);

describe("the 3D view of the page", () => {
  it("loads nothing and asks for nothing before it is opened", () => {
    panel.facts = { footprint: [] };
    panel.view = view();
    expect(load).not.toHaveBeenCalled();
    expect(sent).toEqual([]);
  });

  it("loads once, reads the description, and tells when it is shown", async () => {
    panel.facts = { footprint: [] };
    panel.sceneShown = true;
    await until(() => expect(FakeScene.made[0]?.describe).toHaveBeenCalledWith(DESCRIPTION));
    expect(found["scene-words"].hidden).toBe(true);
    panel.sceneShown = false;
    panel.sceneShown = true;
    await until(() => expect(FakeScene.made[0].shown).toBe(true));
    expect(load).toHaveBeenCalledTimes(1);
    expect(FakeScene.made[0].describe).toHaveBeenCalledTimes(1);
    expect(sent.map(({ wanted }) => wanted)).toEqual([true, false, true]);
  });

  it("tells it again after each connection", () => {
    panel.sceneShown = true;
    expect(sent).toEqual([]);
    panel.facts = { footprint: [] };
    panel.facts = { footprint: [] };
    expect(sent).toEqual(Array(2).fill({ t: "show_joints", wanted: true }));
  });

  it("says why the console has no description", async () => {
    answers["/description"] = [404, { detail: "Not known yet." }];
    panel.sceneShown = true;
    await until(() => expect(found["scene-words"].textContent).toBe("Not known yet."));
    expect(FakeScene.made[0].describe).toHaveBeenCalledWith(null);
  });

  it("says that the browser cannot draw, and reads nothing", async () => {
    FakeScene.draws = false;
    panel.sceneShown = true;
    await until(() => expect(found["scene-words"].textContent).toBe("No WebGL."));
    expect(FakeScene.made[0].describe).not.toHaveBeenCalled();
  });

  it("says that it could not be loaded, and tries again when chosen again", async () => {
    load.mockRejectedValueOnce(new Error("offline"));
    panel.sceneShown = true;
    await until(() => expect(found["scene-words"].textContent).toContain("could not be loaded"));
    panel.sceneShown = false;
    panel.sceneShown = true;
    await until(() => expect(FakeScene.made).toHaveLength(1));
  });

  it("lists what is not drawn as it is", async () => {
    panel.sceneShown = true;
    await until(() => expect(FakeScene.made).toHaveLength(1));
    const notes = new CustomEvent("notes", { detail: ["“a.stl” is broken.", "“b.stl” is lost."] });
    FakeScene.made[0].dispatchEvent(notes);
    expect(found["scene-more"].hidden).toBe(false);
    expect(found["scene-notes"].children).toHaveLength(2);
  });

  it("reads the description again after the robot was away", async () => {
    vi.useFakeTimers();
    panel.sceneShown = true;
    await vi.advanceTimersByTimeAsync(10);
    panel.stale = true;
    answers["/description"] = [200, { ...DESCRIPTION, digest: "b" }];
    await vi.advanceTimersByTimeAsync(10_000);
    expect(FakeScene.made[0].describe).toHaveBeenLastCalledWith({ ...DESCRIPTION, digest: "b" });
    vi.useRealTimers();
  });

  it("keeps the robot over a passing error, and drops one that is gone", async () => {
    vi.useFakeTimers();
    panel.sceneShown = true;
    await vi.advanceTimersByTimeAsync(10);
    answers["/description"] = [503, { detail: "The database is away." }];
    await vi.advanceTimersByTimeAsync(70_000);
    expect(FakeScene.made[0].describe).toHaveBeenCalledTimes(1);
    answers["/description"] = [404, { detail: "Not known any more." }];
    await vi.advanceTimersByTimeAsync(10_000);
    expect(FakeScene.made[0].describe).toHaveBeenLastCalledWith(null);
    vi.useRealTimers();
  });

  it("follows a robot that was started anew", async () => {
    vi.useFakeTimers();
    panel.sceneShown = true;
    await vi.advanceTimersByTimeAsync(10);
    answers["/description"] = [200, { ...DESCRIPTION, digest: "b" }];
    await vi.advanceTimersByTimeAsync(70_000);
    expect(FakeScene.made[0].describe).toHaveBeenLastCalledWith({ ...DESCRIPTION, digest: "b" });
    expect(FakeScene.made[0].describe).toHaveBeenCalledTimes(2);
    vi.useRealTimers();
  });

  it("reads a description once while it stays the same", async () => {
    vi.useFakeTimers();
    panel.sceneShown = true;
    await vi.advanceTimersByTimeAsync(10);
    await vi.advanceTimersByTimeAsync(70_000);
    answers["/description"] = [404, { detail: "Not known any more." }];
    await vi.advanceTimersByTimeAsync(70_000);
    expect(asked.slice(0, 2)).toEqual([
      { isKnown: false },
      { isKnown: true, "If-None-Match": '"a"' },
    ]);
    expect(asked.at(-1)).toEqual({ isKnown: false }); // nothing is drawn any more: read the whole description
    expect(found["scene-words"].textContent).toBe("Not known any more.");
    vi.useRealTimers();
  });
});
