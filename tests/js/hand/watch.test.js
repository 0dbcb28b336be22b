import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Pad } from "../../../static/js/drive/input/gamepad.js";
import { Stick } from "../../../static/js/drive/input/stick.js";
import { HeldKeys } from "../../../static/js/hand/held_keys.js";
import { PointerGrip } from "../../../static/js/hand/pointer_grip.js";
import { hand } from "../../../static/js/hand/watch.js";
import { lostText } from "../../../static/js/hand/words.js";
import { point, type } from "./events.js";

const happens = (target, name, facts = {}) => {
  const event = new Event(name, { bubbles: true, cancelable: true });
  target.dispatchEvent(Object.assign(event, facts));
};

describe("the watch on the hand", () => {
  let grip;
  let focus;

  beforeEach(() => {
    vi.useFakeTimers();
    focus = vi.spyOn(document, "hasFocus").mockReturnValue(true);
    grip = { lose: vi.fn() };
    hand.begin(grip);
  });

  afterEach(() => {
    hand.end(grip);
    document.body.replaceChildren();
    vi.restoreAllMocks();
    vi.useRealTimers();
  });

  const body = () => document.body;
  const field = () => document.body.appendChild(document.createElement("input"));
  const dialog = () => document.body.appendChild(document.createElement("dialog"));

  it.each([
    ["menu", body, "contextmenu", {}],
    ["button", body, "pointerdown", { button: 2 }],
    ["button", body, "auxclick", {}],
    ["drag", body, "dragstart", {}],
    ["drag", body, "dragenter", {}],
    ["modifier", body, "keydown", { key: "Meta" }],
    ["modifier", body, "keydown", { key: "w", ctrlKey: true }],
    ["modifier", body, "keydown", { key: "w", getModifierState: (key) => key === "AltGraph" }],
    ["text", body, "keydown", { key: "Process", keyCode: 229 }],
    ["text", body, "keydown", { key: "Dead" }],
    ["taken", body, "keydown", { key: "F10" }],
    ["text", body, "compositionstart", {}],
    ["text", field, "focusin", {}],
    ["dialog", dialog, "toggle", { newState: "open" }],
    ["dialog", () => window, "beforeprint", {}],
    ["blurred", () => window, "blur", {}],
    ["hidden", () => document, "visibilitychange", {}],
    ["hidden", () => window, "pagehide", {}],
    ["stood-still", () => document, "freeze", {}],
    ["stood-still", () => document, "resume", {}],
  ])("ends a grip: %s", (reason, target, name, facts) => {
    happens(target(), name, facts);
    vi.advanceTimersByTime(1); // a page that prints stands still until then
    expect(grip.lose).toHaveBeenCalledExactlyOnceWith(reason);
  });

  it.each([
    ["a press of the main button elsewhere", "pointerdown", { button: 0 }],
    ["Shift", "keydown", { key: "Shift", shiftKey: true }],
    ["a long touch of a stick", "contextmenu", { prevented: true }],
  ])("is not disturbed by %s", (_, name, facts) => {
    const prevent = (event) => facts.prevented && event.preventDefault();
    document.body.addEventListener(name, prevent, { once: true });
    happens(document.body, name, facts);
    expect(grip.lose).not.toHaveBeenCalled();
  });

  it("ends a grip when the focus is gone without an event", () => {
    focus.mockReturnValue(false);
    vi.advanceTimersByTime(200);
    expect(grip.lose).toHaveBeenCalledExactlyOnceWith("blurred");
  });

  it("ends a grip when a focus is gone that came after the press", () => {
    hand.end(grip);
    focus.mockReturnValue(false);
    hand.begin(grip);
    vi.advanceTimersByTime(200);
    focus.mockReturnValue(true);
    vi.advanceTimersByTime(200);
    expect(grip.lose).not.toHaveBeenCalled();
    focus.mockReturnValue(false);
    vi.advanceTimersByTime(200);
    expect(grip.lose).toHaveBeenCalledExactlyOnceWith("blurred");
  });

  it.each(["range", "checkbox", "radio", "button"])(
    "leaves a finger when another one goes to a %s, but no key",
    (kind) => {
      const key = { lose: vi.fn(), usesKeys: true };
      hand.begin(key);
      const input = Object.assign(document.createElement("input"), { type: kind });
      happens(document.body.appendChild(input), "focusin");
      expect(grip.lose).not.toHaveBeenCalled();
      expect(key.lose).toHaveBeenCalledExactlyOnceWith("text");
    },
  );

  it("ends a grip when the page was frozen or the computer slept", () => {
    vi.setSystemTime(Date.now() + 3_600_000); // only the clock went on
    vi.advanceTimersByTime(100);
    expect(grip.lose).toHaveBeenCalledExactlyOnceWith("stood-still");
  });

  it("asks for a sign before it ends a silent grip, and says how long it waited", () => {
    const said = [];
    const listening = new AbortController();
    const keep = ({ type: name, detail }) => said.push([name, detail]);
    for (const name of ["soon", "lost"]) hand.addEventListener(name, keep, listening);
    vi.advanceTimersByTime(2_700);
    expect(said).toEqual([["soon", true]]);
    hand.prove(grip);
    vi.advanceTimersByTime(4_200);
    listening.abort();
    expect(said.map(([name]) => name)).toEqual(["soon", "soon", "soon", "soon", "lost"]);
    expect(lostText(said.at(-1)[1])).toContain("no sign of a hand for 4 s");
  });

  it("leaves a grip without a hand to the page", () => {
    const stuck = { lose: vi.fn(), withoutHand: true };
    hand.begin(stuck, 30_000);
    happens(document.body, "contextmenu");
    expect(stuck.lose).not.toHaveBeenCalled();
    happens(window, "blur");
    expect(stuck.lose).toHaveBeenCalledExactlyOnceWith("blurred");
  });
});

describe("beside an open dialog", () => {
  const barred = vi.fn();
  let dialog;

  beforeEach(() => {
    vi.useFakeTimers();
    vi.spyOn(document, "hasFocus").mockReturnValue(true);
    hand.addEventListener("barred", barred);
    dialog = document.body.appendChild(document.createElement("dialog"));
    dialog.setAttribute("open", "");
  });

  afterEach(() => {
    hand.removeEventListener("barred", barred);
    barred.mockClear();
    document.body.replaceChildren();
    vi.restoreAllMocks();
    vi.useRealTimers();
  });

  it("no key moves anything, until it is pressed again after the dialog closed", () => {
    const changed = vi.fn();
    const keys = new HeldKeys(window, ["KeyW"], () => true, changed);
    type(document.body, "keydown", "KeyW");
    dialog.removeAttribute("open");
    type(document.body, "keydown", "KeyW", { repeat: true });
    expect(changed).not.toHaveBeenCalled();
    expect(barred).toHaveBeenCalledOnce();
    type(document.body, "keydown", "KeyW");
    expect(changed).toHaveBeenCalledOnce();
    keys.close();
  });

  it("no finger holds a stick", () => {
    const begin = vi.fn(() => true);
    const zone = document.body.appendChild(document.createElement("div"));
    const grip = new PointerGrip(zone, { begin, end() {} });
    point(zone, "pointerdown");
    expect([begin.mock.calls.length, grip.isHeld]).toEqual([0, false]);
    dialog.removeAttribute("open");
    point(zone, "pointerdown");
    expect(grip.isHeld).toBe(true);
    grip.close();
  });

  it("no gamepad drives, until its stick has rested after the dialog closed", () => {
    const stick = new Stick();
    const pad = new Pad(stick, "pad");
    const read = (up) => pad.read({ mapping: "standard", axes: [0, -up], buttons: [] }, false);
    for (const up of [0, 1, 1]) read(up);
    dialog.removeAttribute("open");
    read(1);
    expect(stick.input).toBeNull();
    expect(barred).toHaveBeenCalledOnce();
    for (const up of [0, 1]) read(up);
    expect(stick.input).toBe("gamepad pad");
    pad.leave();
  });

  it("nothing goes on without a hand", () => {
    const stuck = { lose: vi.fn(), withoutHand: true };
    hand.begin(stuck, 30_000);
    vi.advanceTimersByTime(100);
    expect(stuck.lose).toHaveBeenCalledExactlyOnceWith("dialog");
  });
});

describe("held keys", () => {
  let keys;
  let held;

  beforeEach(() => {
    vi.useFakeTimers();
    vi.spyOn(document, "hasFocus").mockReturnValue(true);
    keys = new HeldKeys(
      window,
      ["KeyW", "KeyA"],
      () => true,
      (now) => {
        held = [...now];
      },
    );
    held = [];
  });

  afterEach(() => {
    keys.close();
    vi.restoreAllMocks();
    vi.useRealTimers();
  });

  const repeat = (code, forMs) => {
    for (let ms = 0; ms < forMs; ms += 50) {
      vi.advanceTimersByTime(50);
      type(document.body, "keydown", code, { repeat: true });
    }
  };

  it("end with Cmd, and do not come back by repeating", () => {
    type(document.body, "keydown", "KeyW");
    type(document.body, "keydown", "MetaLeft", { key: "Meta" });
    expect(held).toEqual([]);
    type(document.body, "keydown", "KeyW", { repeat: true, metaKey: true });
    type(document.body, "keyup", "MetaLeft", { key: "Meta" }); // macOS told of no release of W
    type(document.body, "keydown", "KeyW", { repeat: true });
    expect(held).toEqual([]);
    type(document.body, "keydown", "KeyW");
    expect(held).toEqual(["KeyW"]);
  });

  it("go on while they repeat, and end when the repeat ends", () => {
    type(document.body, "keydown", "KeyW");
    repeat("KeyW", 10_000);
    expect(held).toEqual(["KeyW"]);
    vi.advanceTimersByTime(1_200);
    expect(held).toEqual([]);
  });

  it("of which only the newest repeats go on together", () => {
    type(document.body, "keydown", "KeyW");
    repeat("KeyW", 1_000);
    type(document.body, "keydown", "KeyA");
    repeat("KeyA", 2_000);
    expect(held).toEqual(["KeyW", "KeyA"]);
    type(document.body, "keyup", "KeyA");
    vi.advanceTimersByTime(3_800); // W does not repeat again
    expect(held).toEqual(["KeyW"]);
    vi.advanceTimersByTime(400);
    expect(held).toEqual([]);
  });

  it("go on while another key of the set is tapped: a hand steers", () => {
    type(document.body, "keydown", "KeyW");
    repeat("KeyW", 1_000);
    for (let ms = 0; ms < 9_000; ms += 3_000) {
      type(document.body, "keydown", "KeyA"); // ends the repeats of W
      type(document.body, "keyup", "KeyA");
      vi.advanceTimersByTime(3_000);
    }
    expect(held).toEqual(["KeyW"]);
  });

  it("go on together while each is pressed again", () => {
    type(document.body, "keydown", "KeyW");
    type(document.body, "keydown", "KeyA");
    for (const code of ["KeyA", "KeyW", "KeyA"]) {
      vi.advanceTimersByTime(2_500);
      type(document.body, "keydown", code);
    }
    expect(held).toEqual(["KeyW", "KeyA"]);
  });

  it.each(["KeyI", "KeyX", "KeyA"])("are not proven by %s, which repeats for ever", (other) => {
    type(document.body, "keydown", "KeyW");
    repeat("KeyW", 1_000);
    type(document.body, "keydown", other);
    repeat(other, 3_800);
    expect(held).toContain("KeyW");
    repeat(other, 400);
    expect(held).toEqual([]);
  });

  it.each(["KeyI", "KeyX"])("are not proven by %s, pressed again and again", (other) => {
    type(document.body, "keydown", "KeyW");
    repeat("KeyW", 1_000);
    for (let ms = 0; ms < 4_200; ms += 700) {
      vi.advanceTimersByTime(700);
      type(document.body, "keydown", other);
      type(document.body, "keyup", other);
    }
    expect(held).not.toContain("KeyW");
  });

  it("whose repeat ended are not helped by the release of a key of a menu", () => {
    type(document.body, "keydown", "KeyW");
    repeat("KeyW", 1_000);
    vi.advanceTimersByTime(500);
    type(document.body, "keyup", "Escape");
    vi.advanceTimersByTime(700);
    expect(held).toEqual([]);
  });

  it("are proven by no pointer", () => {
    type(document.body, "keydown", "KeyW");
    for (let ms = 0; ms < 4_200; ms += 100) {
      vi.advanceTimersByTime(100);
      point(document.body, "pointermove", { clientX: ms, buttons: 0 });
    }
    expect(held).toEqual([]);
  });
});
