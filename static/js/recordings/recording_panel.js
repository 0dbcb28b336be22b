/** *Record* and *Keep this* on the control page, and what everybody there sees of a recording. */

import { closable } from "../lib/dialog.js";
import { dim, mark, setText, setTextOrHide, show } from "../lib/dom.js";
import { blackBoxText, goesOn, recordingLines, sizeText } from "./recording_words.js";

const MAY_WITHOUT_CONTROL = new Set(["supervisor", "staff"]);
const PATIENCE_MS = 12_000; // a recorder takes seconds to start

export class RecordingPanel {
  static hears = ["state.recording", "state.black_box", "mayAct", "role"];
  static requests = {
    record: { control: "none", patienceMs: PATIENCE_MS, name: () => gettext("Record") },
    record_end: { control: "none", patienceMs: PATIENCE_MS, name: () => gettext("End recording") },
    keep_this: {
      control: "none",
      patienceMs: PATIENCE_MS,
      name: () => gettext("Keep this"),
      done: () => gettext("The last 30 s and the next 15 s are kept."),
    },
  };
  #parts;
  #request;
  #notify;
  #recording = null;
  #box = null;
  #mayAct = false;
  #role = "observer";
  #known = null; // the recording that was told; undefined: none was seen yet
  #listening = new AbortController();

  /** @param {import("../control/panels/page_panels.js").Page} page */
  constructor({ parts, request, notify }) {
    this.#parts = parts;
    this.#request = request;
    this.#notify = notify;
    const { signal } = this.#listening;
    const on = (part, event, act) => parts[part].addEventListener(event, act, { signal });
    on("record-open", "click", () => this.#open());
    on("recording", "click", () => this.#open());
    on("keep-this", "click", () => this.#keep());
    on("record-keep", "click", () => this.#keep());
    on("record-end", "click", () => this.#end());
    on("record-form", "submit", (event) => this.#begin(event));
    on("record-form", "change", () => this.#showChoice());
    closable(parts["record-dialog"], signal);
    this.#show();
  }

  set recording(recording) {
    this.#recording = recording ?? null;
    this.#tell();
    this.#show();
  }

  set black_box(box) {
    this.#box = box ?? null;
    this.#show();
  }

  set mayAct(mayAct) {
    this.#mayAct = Boolean(mayAct);
    this.#show();
  }

  set role(role) {
    this.#role = role;
    this.#show();
  }

  close() {
    this.#listening.abort();
    this.#parts["record-dialog"].close();
  }

  get #may() {
    return this.#mayAct || MAY_WITHOUT_CONTROL.has(this.#role);
  }

  /** Whether this person began it: the server knows; this only offers the button. */
  get #isMine() {
    return this.#recording.by === this.#parts["record-dialog"].dataset.name;
  }

  /** Say once who records: everybody whom the robot sees is told. */
  #tell() {
    const now = goesOn(this.#recording) ? this.#recording.recording : null;
    if (now === this.#known) return;
    this.#known = now;
    if (!now) return;
    const text = interpolate(gettext("%s records this robot."), [this.#recording.by]);
    this.#notify({ level: "info", code: `recording ${now}`, text });
  }

  #show() {
    const { recording: chip, "keep-this": keep, "record-dialog": dialog } = this.#parts;
    const on = goesOn(this.#recording);
    show(chip, on);
    if (on) {
      const size = sizeText(this.#recording.bytes ?? 0);
      setText(this.#parts["recording-size"], size);
      mark(chip, "level", this.#recording.refusal ? "warn" : "fail");
      chip.title = recordingLines(this.#recording)[0];
    }
    dim(keep, !this.#may || !this.#box);
    if (dialog.open) this.#showDialog();
  }

  #showDialog() {
    const on = goesOn(this.#recording);
    const { "record-state": state, "record-problem": problem } = this.#parts;
    setText(state, recordingLines(this.#recording).join(" "));
    setTextOrHide(problem, this.#recording?.refusal?.text ?? "");
    show(this.#parts["record-form"], this.#may && !on);
    show(this.#parts["record-end"], on && (this.#may || this.#isMine));
    show(this.#parts["record-keep"], this.#may && Boolean(this.#box));
    setTextOrHide(this.#parts["black-box-words"], blackBoxText(this.#box));
  }

  #showChoice() {
    const { what, topics } = this.#parts["record-form"].elements;
    const isChosen = what.value === "chosen";
    show(this.#parts["record-topics"], isChosen);
    topics.required = isChosen;
  }

  #open() {
    this.#parts["record-dialog"].show();
    this.#showChoice();
    this.#showDialog();
  }

  #begin(event) {
    event.preventDefault();
    const { what, topics, reason } = this.#parts["record-form"].elements;
    const chosen = topics.value.split(/[\s,]+/).filter(Boolean);
    if (what.value === "chosen" && !chosen.length) {
      topics.focus();
      return;
    }
    const asked = what.value === "chosen" ? chosen : what.value;
    this.#request({ t: "record", topics: asked, reason: reason.value.trim() });
  }

  #end() {
    this.#request({ t: "record_end", recording: this.#recording.recording });
  }

  #keep() {
    this.#request({ t: "keep_this" });
  }
}
