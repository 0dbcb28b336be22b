import { describe, expect, test } from "vitest";
import { controlWords, lessonWords } from "../../../../static/js/control/status/control_words.js";

const lesson = {
  booking: "b",
  name: "HRI 2026",
  leads: false,
  held: false,
  turn: "Ada",
  yours: false,
  driving: true,
  turn_s: 130,
  place: 2,
  waiting: 5,
};
const other = { state: "other", holder: "Ada", requests: [], lesson };

describe("the line of a lesson", () => {
  test("says who drives, how long, and one's place", () => {
    expect(lessonWords(other, 10)).toBe("Ada drives, 2:00 left. Your place in line: 2.");
    const called = { ...lesson, driving: false, turn_s: 90, place: null };
    expect(lessonWords({ ...other, lesson: called }, 0)).toBe("Ada is called, 1:30 left.");
    expect(lessonWords({ ...other, lesson: null }, 0)).toBe("");
  });

  test("says that it is one's turn", () => {
    const yours = { ...lesson, yours: true, place: null };
    expect(lessonWords({ ...other, lesson: { ...yours, driving: false, turn_s: 60 } }, 0)).toBe(
      "Your turn: take control within 1:00",
    );
    expect(lessonWords({ ...other, lesson: yours }, 0)).toBe("Your turn. 5 people wait.");
  });

  test("tells the teacher how many wait, and that the line is held", () => {
    const led = { ...lesson, leads: true, place: null, held: true, turn: null, waiting: 1 };
    expect(lessonWords({ ...other, lesson: led }, 0)).toBe("The line is held. 1 person waits.");
  });
});

test("people of a lesson leave its line, others join it, and the teacher takes back", () => {
  expect(controlWords(other).actions).toEqual(["ask_cancel"]);
  expect(controlWords({ ...other, lesson: { ...lesson, place: null } }).actions).toEqual(["ask"]);
  const teacher = { ...other, may_take_over: true, may_take_back: true, lesson: null };
  expect(controlWords(teacher).actions).toEqual(["ask", "take_back"]);
});
