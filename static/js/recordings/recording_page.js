/** The page of a recording: its replay. */

import { readJson } from "../connection/read.js";
import { PlanView } from "../drive/plan_view.js";
import { mark, parts as partsOf, setText, setTextOrHide } from "../lib/dom.js";
import { ScenePanel } from "../scene/scene_panel.js";
import { changes } from "./changes.js";
import { topics } from "./channels.js";
import { downloads } from "./downloads.js";
import { Player } from "./player.js";
import { RecordedPictures } from "./recorded_pictures.js";
import { RecordedPlots } from "./recorded_plots.js";
import { RecordedViews } from "./recorded_views.js";
import { saysOf } from "./recording_words.js";
import { Timeline } from "./timeline.js";

const STEP_S = 0.1; // of the buttons; views are so far apart
const OLD_S = 1; // a view this much older than the moment is drawn pale
const STICK_R = 34; // way of the knob, in units of its picture
const KEYS = { ",": -STEP_S, ".": STEP_S, j: -10, l: 10 };

class Replay {
  #parts;
  #player;
  #views;
  #shown = null; // the view that is drawn
  #drawings;
  #pictures;
  #plots;
  #passedMs = null;

  constructor(root, data) {
    this.#parts = partsOf(root);
    const asked = Number(new URLSearchParams(location.search).get("t") ?? Number.NaN);
    this.#player = new Player(data.sees, Number.isFinite(asked) ? asked : data.beginS);
    this.#views = new RecordedViews((from, to) =>
      readJson(
        `${data.address}/views?${new URLSearchParams({ from, to })}`,
        gettext("The recording could not be read."),
      ),
    );
    this.#draw(root, data.facts);
    this.#pictures = new RecordedPictures(this.#parts, data.address);
    this.#plots = new RecordedPlots(this.#parts, data.address);
    new Timeline(this.#parts, this.#player, data);
    this.#listen();
    downloads(this.#parts, this.#player);
    changes(this.#parts, data.address);
    this.#read(data.address);
    this.#show();
  }

  #draw(root, facts) {
    const given = { root, parts: this.#parts, send() {}, tell() {} };
    const plan = new PlanView(given);
    const scene = new ScenePanel(given);
    this.#drawings = [plan, scene];
    for (const drawing of this.#drawings) drawing.facts = facts;
    const { "view-choice": choice, views } = this.#parts;
    choice.addEventListener("click", ({ target }) => {
      const view = target.closest("[data-view]")?.dataset.view;
      if (!view) return;
      mark(views, "view", view);
      scene.sceneShown = view === "scene";
      for (const button of choice.children)
        button.setAttribute("aria-pressed", String(button.dataset.view === view));
    });
  }

  #listen() {
    const { play, before, after, speed, link } = this.#parts;
    const player = this.#player;
    player.addEventListener("moment", () => this.#show());
    player.addEventListener("playing", () => this.#showPlaying());
    this.#views.addEventListener("read", () => this.#show());
    this.#views.addEventListener("problem", ({ detail }) => this.#say(detail));
    play.addEventListener("click", () => this.#toggle());
    before.addEventListener("click", () => this.#step(-STEP_S));
    after.addEventListener("click", () => this.#step(STEP_S));
    speed.addEventListener("change", () => {
      player.speed = Number(speed.value);
    });
    link.addEventListener("click", () => this.#copyLink());
    document.addEventListener("keydown", (event) => this.#pressed(event));
  }

  async #read(address) {
    try {
      const { contents } = await readJson(address, gettext("The recording could not be read."));
      this.#pictures.channels = contents.channels;
      this.#plots.channels = contents.channels;
      for (const topic of topics(contents.channels))
        this.#parts.topics.add(new Option(topic, topic));
      if (!contents.has_views)
        this.#say(gettext("It has no plan: the console’s own topics were not recorded."));
    } catch (error) {
      setText(this.#parts["camera-words"], "");
      this.#say(error.message);
    }
  }

  #show() {
    const { atS, part } = this.#player;
    const found = this.#views.at(atS, part);
    if (found && found !== this.#shown) {
      this.#shown = found;
      const [, view, command] = found;
      for (const drawing of this.#drawings) drawing.view = view;
      setText(this.#parts.says, saysOf(view));
      this.#showStick(command);
    }
    const stale = !found || atS - found[0] > OLD_S;
    for (const drawing of this.#drawings) drawing.stale = stale;
    this.#pictures.show(atS, part);
    this.#plots.show(atS, part);
  }

  /** @param {?{drive: {x: number, y: number, w: number}}} command null: nobody drove */
  #showStick(command) {
    const { x = 0, y = 0, w = 0 } = command?.drive ?? {};
    const { knob } = this.#parts;
    knob.setAttribute("cx", String(-STICK_R * (w || y)));
    knob.setAttribute("cy", String(-STICK_R * x));
    mark(knob, "held", command !== null && command !== undefined);
    mark(knob, "refused", Boolean(command?.refusal));
  }

  #showPlaying() {
    const { play } = this.#parts;
    const { playing } = this.#player;
    setText(play, playing ? "❚❚" : "▶\ufe0e");
    play.setAttribute("aria-label", playing ? play.dataset.pause : play.dataset.play);
    this.#passedMs = null;
    if (playing) requestAnimationFrame((ms) => this.#pass(ms));
  }

  /** Time stands still while the views of the moment are read. */
  #pass(ms) {
    if (!this.#player.playing) return;
    const seconds = this.#passedMs === null ? 0 : (ms - this.#passedMs) / 1000;
    this.#passedMs = ms;
    const { atS, part } = this.#player;
    if (this.#views.has(atS, part)) this.#player.pass(seconds);
    requestAnimationFrame((next) => this.#pass(next));
  }

  #toggle() {
    this.#player.playing = !this.#player.playing;
  }

  #step(seconds) {
    this.#player.playing = false;
    this.#player.atS += seconds;
  }

  #pressed(event) {
    const isTyped = event.target.closest("input:not([type=range]), select, textarea, dialog");
    if (isTyped || event.altKey || event.ctrlKey || event.metaKey) return;
    if (event.key === "k") this.#toggle();
    else if (KEYS[event.key]) this.#step(KEYS[event.key]);
  }

  async #copyLink() {
    const address = new URL(location.href);
    address.searchParams.set("t", this.#player.atS.toFixed(1));
    history.replaceState(null, "", address);
    const { link } = this.#parts;
    try {
      await navigator.clipboard.writeText(address.href);
      setText(link, gettext("Copied"));
    } catch {
      setText(link, gettext("It is in the address bar"));
    }
  }

  #say(text) {
    setTextOrHide(this.#parts.problem, text);
  }
}

const root = document.querySelector("[data-page=recording]");
new Replay(root, JSON.parse(document.getElementById("recording").textContent));
