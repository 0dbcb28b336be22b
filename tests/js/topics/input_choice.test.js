import { describe, expect, it, vi } from "vitest";
import { candidates, InputChoice } from "../../../static/js/topics/input_choice.js";

const TWIST = "geometry_msgs/Twist";
const OFFER = { topic: "/key_vel", type: TWIST, chooseable: { "/phone_vel": "operator" } };
const GRAPH = {
  topics: [
    { name: "/joy_vel", type: TWIST },
    { name: "/key_vel", type: TWIST },
    { name: "/odom", type: "nav_msgs/Odometry" },
    { name: "/phone_vel", type: TWIST },
  ],
  actions: [{ name: "/tts", type: "pal_interaction_msgs/TtsAction" }],
};

describe("topics to send input to", () => {
  it("list the default, the choices, the rest with reasons", () => {
    const found = candidates(GRAPH, OFFER, "operator", "/phone_vel");
    expect(found.map(({ name, mark, why }) => [name, mark, why])).toEqual([
      ["/key_vel", "default", ""],
      ["/phone_vel", "chosen", ""],
      ["/joy_vel", "", "not on the allow-list"],
      ["/odom", "", "wrong type"],
    ]);
  });

  it("show topics of other roles, marked so", () => {
    const offer = { ...OFFER, chooseable: { "/phone_vel": "supervisor", "/joy_vel": "staff" } };
    const whyOf = (role) =>
      Object.fromEntries(candidates(GRAPH, offer, role).map(({ name, why }) => [name, why]));
    expect(whyOf("operator")["/phone_vel"]).toBe("for supervisors");
    expect(whyOf("supervisor")["/phone_vel"]).toBe("");
    expect(whyOf("supervisor")["/joy_vel"]).toBe("for staff");
  });

  it("show actions if the input is an action", () => {
    const offer = { topic: "/tts", type: "pal_interaction_msgs/TtsAction", chooseable: {} };
    expect(candidates(GRAPH, offer, "operator").map(({ name }) => name)).toEqual(["/tts"]);
  });
});

describe("the rows of input topics", () => {
  it("mark the default, and lead back to it with one press", () => {
    const list = document.createElement("ul");
    const choices = new InputChoice(list);
    const chosen = vi.fn();
    choices.addEventListener("choose", ({ detail }) => chosen(detail));
    choices.uses = { drive: OFFER };
    choices.mayAct = true;
    const [back] = list.querySelectorAll("button");
    expect(list.textContent).toContain("/key_vel default");
    expect(back.hidden).toBe(true);
    choices.chosen = { drive: "/phone_vel" };
    expect(list.textContent).toContain("/phone_vel chosen");
    back.click();
    expect(chosen).toHaveBeenCalledWith({ use: "drive", topic: null });
    choices.mayAct = false;
    expect(back.getAttribute("aria-disabled")).toBe("true");
  });

  it("say why a topic would ignore input", () => {
    const list = document.createElement("ul");
    const choices = new InputChoice(list);
    choices.uses = { drive: { ...OFFER, refusal: { text: "Nothing listens to /key_vel." } } };
    expect(list.querySelector(".quiet").textContent).toBe("Nothing listens to /key_vel.");
    choices.uses = { drive: OFFER };
    expect(list.querySelector(".quiet").hidden).toBe(true);
  });
});
