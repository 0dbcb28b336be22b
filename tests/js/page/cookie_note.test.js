import { beforeEach, expect, it } from "vitest";
import { showOnce } from "../../../static/js/page/cookie_note.js";

let note;

beforeEach(() => {
  localStorage.clear();
  note = document.createElement("aside");
  note.append(document.createElement("button"));
  note.hidden = true;
});

it("the note on cookies is shown until somebody has read it", () => {
  showOnce(note);
  expect(note.hidden).toBe(false);
  note.querySelector("button").click();
  expect(note.hidden).toBe(true);
  showOnce(note);
  expect(note.hidden).toBe(true);
});
