import { beforeEach, describe, expect, it, vi } from "vitest";
import { parts as partsOf } from "../../../static/js/lib/dom.js";
import { RecordingPanel } from "../../../static/js/recordings/recording_panel.js";

const GOING = {
  recording: "r1",
  by: "Olga",
  since_s: 62,
  left_s: 600,
  bytes: 2_500_000,
  topics: "all",
};
let parts;
let request;
let notices;
let panel;

beforeEach(() => {
  document.body.innerHTML = `
    <button data-part="record-open"></button><button data-part="keep-this"></button>
    <button data-part="recording" hidden><span data-part="recording-size"></span></button>
    <dialog data-part="record-dialog"><p data-part="record-state"></p><p data-part="record-problem"></p>
      <form data-part="record-form" hidden>
        <select name="what"><option value="pictures_not"></option><option value="all"></option><option value="chosen"></option></select>
        <label data-part="record-topics"><input name="topics"></label><input name="reason"><button></button>
      </form>
      <p data-part="black-box-words"></p>
      <button data-part="record-keep"></button><button data-part="record-end"></button>
    </dialog>`;
  parts = partsOf(document);
  request = vi.fn(async () => null);
  notices = [];
  panel = new RecordingPanel({ parts, request, notify: (notice) => notices.push(notice) });
});

const submit = () => parts["record-form"].dispatchEvent(new Event("submit", { cancelable: true }));

describe("everybody on the page", () => {
  it("sees that it records, how much, and is told once who does", () => {
    panel.recording = GOING;
    panel.recording = { ...GOING, bytes: 3_000_000 };
    expect(parts.recording.hidden).toBe(false);
    expect(parts["recording-size"].textContent).toBe("3.0 MB");
    expect(notices.map(({ text }) => text)).toEqual(["Olga records this robot."]);
    panel.recording = null;
    expect(parts.recording.hidden).toBe(true);
  });

  it("cannot begin or end one without the right", () => {
    panel.recording = GOING;
    parts["record-open"].click();
    expect([parts["record-form"].hidden, parts["record-end"].hidden]).toEqual([true, true]);
    expect(parts["record-state"].textContent).toContain("Olga records this robot, since 1:02.");
  });
});

it("is ended by who began it, also without control", () => {
  parts["record-dialog"].dataset.name = "Olga";
  panel.recording = GOING;
  parts["record-open"].click();
  expect([parts["record-form"].hidden, parts["record-end"].hidden]).toEqual([true, false]);
});

describe("who has control", () => {
  beforeEach(() => {
    panel.mayAct = true;
    parts["record-open"].click();
  });

  it("records chosen topics", () => {
    const { what, topics, reason } = parts["record-form"].elements;
    what.value = "chosen";
    topics.value = " /scan, /tf ";
    reason.value = "report";
    submit();
    expect(request).toHaveBeenCalledWith({
      t: "record",
      topics: ["/scan", "/tf"],
      reason: "report",
    });
  });

  it("records nothing if no topic is chosen", () => {
    const { what, topics } = parts["record-form"].elements;
    what.value = "chosen";
    topics.value = " , ";
    submit();
    expect(request).not.toHaveBeenCalled();
  });

  it("records all but pictures at first", () => {
    submit();
    expect(request).toHaveBeenCalledWith({ t: "record", topics: "pictures_not", reason: "" });
  });

  it("ends it, and keeps what was", () => {
    panel.recording = GOING;
    panel.black_box = { seconds: 60 };
    parts["record-end"].click();
    parts["record-keep"].click();
    expect(request.mock.calls.map(([{ t }]) => t)).toEqual(["record_end", "keep_this"]);
  });

  it("reads why nothing is written", () => {
    panel.recording = { ...GOING, refusal: { code: "disk_slow", text: "The disk is too slow." } };
    expect(parts["record-problem"].textContent).toBe("The disk is too slow.");
  });
});
