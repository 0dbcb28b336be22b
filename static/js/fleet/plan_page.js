/** The fleet map: each map with all robots that have it now, live; the others beside it, with the reason. */

import { Heartbeat } from "../connection/heartbeat.js";
import { LiveSocket, socketUrl } from "../connection/socket.js";
import { make, makeButton, mark, parts, setText, setTextOrHide, show } from "../lib/dom.js";
import { MapView } from "../navigation/map_view.js";
import { readMaps, readPicture } from "../navigation/places_api.js";
import { cardOf } from "./card_words.js";
import { ConsoleNews } from "./console_news.js";
import { whereText, whyNowhere } from "./plan_words.js";

const MAPS_MS = 20_000;
const SIGNED_OUT = 4401;
const ZOOM = 1.5;

/** One map: its picture, and the list of robots on it. */
class PlanMap {
  element;
  list = make("ul", { className: "plan-robots" });
  #title = make("h2");
  // Link to the robot that was pressed on the map.
  #picked = make("a", { className: "button primary plan-picked" });
  #view;
  #map = null;
  #drawn = false;

  /** @param {HTMLElement} into the map is put there at once, because it reads its colours there */
  constructor(into, help) {
    const canvas = make("canvas");
    canvas.tabIndex = 0;
    canvas.dir = "ltr";
    canvas.setAttribute("role", "application");
    canvas.setAttribute("aria-label", help);
    const buttons = [
      ["+", gettext("Zoom in"), () => this.#view.zoom(ZOOM)],
      ["−", gettext("Zoom out"), () => this.#view.zoom(1 / ZOOM)],
      [gettext("Whole map"), null, () => this.#view.fit()],
    ].map(([text, label, press]) => {
      const button = makeButton({ className: "toggle", text }, press);
      if (label) button.setAttribute("aria-label", label);
      return button;
    });
    const zoom = make("div", { className: "plan-zoom", children: buttons });
    zoom.setAttribute("role", "group");
    zoom.setAttribute("aria-label", gettext("Zoom"));
    const view = make("div", { className: "plan-view", children: [canvas, zoom, this.#picked] });
    this.element = make("section", {
      className: "plan-map",
      children: [this.#title, view, this.list],
    });
    into.append(this.element);
    this.#view = new MapView(canvas);
    this.#view.addEventListener("pick", ({ detail }) => this.#pick(detail.robot ?? null));
    this.#pick(null);
  }

  get places() {
    return this.#map?.places ?? [];
  }

  /** @param {object} map as the API describes it; its content never changes, but its name and places do */
  async take(map) {
    this.#map = map;
    setText(this.#title, map.name || gettext("Map without a name"));
    this.#view.places = map.places;
    if (this.#drawn) return;
    this.#view.show(map, await readPicture(map));
    this.#drawn = true;
  }

  /** @param {{name: string, address: string, location: object, going: ?object}[]} robots */
  set robots(robots) {
    this.#view.robots = robots;
  }

  /** Offer a link to the page of a pressed robot. By keyboard, people open the same page from the list. */
  #pick(robot) {
    show(this.#picked, robot !== null);
    if (!robot) return;
    setText(this.#picked, interpolate(gettext("Open %s"), [robot.name]));
    this.#picked.href = robot.address;
  }

  close() {
    this.#view.close();
    this.element.remove();
  }
}

export class PlanPage {
  #root;
  #parts;
  #socket;
  #heartbeat;
  #rows = new Map(); // by robot: its entry in a list
  #maps = new Map(); // by the map's name in the API
  #mapOf = new Map(); // name of its map, by robot
  #isTold = false; // the console has said something about the robots
  #news;
  #timer;

  constructor(root) {
    this.#root = root;
    this.#parts = parts(document);
    for (const row of root.querySelectorAll("[data-robot]"))
      this.#rows.set(row.dataset.robot, { row, own: parts(row), ...linkIn(row) });
    this.#socket = new LiveSocket(socketUrl(root.dataset.socket));
    this.#heartbeat = new Heartbeat(this.#socket);
    this.#news = new ConsoleNews(this.#socket, this.#parts.connection, (isStale) => {
      for (const { row } of this.#rows.values()) mark(row, "stale", isStale);
      mark(this.#parts.maps, "stale", isStale);
    });
    this.#socket.addEventListener("message", ({ detail }) => this.#receive(detail));
    this.#socket.addEventListener("open", () => this.#heartbeat.begin());
    this.#socket.addEventListener("down", ({ detail }) => {
      if (detail.code === SIGNED_OUT) location.reload(); // the server shows the sign-in page
    });
    this.#timer = setInterval(() => this.#loadMaps(), MAPS_MS);
    this.#loadMaps();
    this.#socket.connect();
  }

  close() {
    clearInterval(this.#timer);
    this.#news.close();
    for (const map of this.#maps.values()) map.close();
    this.#heartbeat.close();
    this.#socket.close();
  }

  async #loadMaps() {
    try {
      const present = (await readMaps()).filter(({ robots }) => robots.length > 0);
      this.#mapOf = new Map(present.flatMap((one) => one.robots.map((slug) => [slug, one.map])));
      for (const [key, map] of this.#maps)
        if (!present.some((one) => one.map === key)) this.#end(key, map);
      for (const one of present) {
        if (!this.#maps.has(one.map)) {
          this.#maps.set(one.map, new PlanMap(this.#parts.maps, this.#root.dataset.help));
        }
      }
      const taken = present.map((one) => this.#maps.get(one.map).take(one));
      const failed = (await Promise.allSettled(taken)).find(({ status }) => status === "rejected");
      setTextOrHide(this.#parts["maps-failed"], failed?.reason.message ?? "");
    } catch (error) {
      setTextOrHide(this.#parts["maps-failed"], error.message);
    }
    this.#show();
  }

  #end(key, map) {
    this.#parts["rest-list"].append(...map.list.children);
    map.close();
    this.#maps.delete(key);
  }

  #receive(message) {
    this.#heartbeat.receive(message);
    if (message.t !== "fleet") return;
    this.#isTold = true;
    this.#show();
    requestAnimationFrame(() => this.#socket.send({ t: "ack" }));
  }

  #show() {
    const drawn = new Map([...this.#maps.values()].map((map) => [map, []]));
    if (this.#isTold)
      for (const [slug, held] of this.#rows)
        this.#showRobot(held, this.#news.robots[slug], slug, drawn);
    for (const [map, robots] of drawn) map.robots = robots;
    show(
      this.#parts.rest,
      this.#parts["rest-list"].querySelector(":scope > :not([hidden])") !== null,
    );
  }

  #showRobot({ row, own, name, address }, robot, slug, drawn) {
    show(row, robot !== undefined); // a robot that this person may not see any more is hidden
    if (!robot) return;
    const map = this.#maps.get(this.#mapOf.get(slug)) ?? null;
    const shown = cardOf(robot);
    const why = whyNowhere(map, robot);
    mark(row, "level", shown.level);
    mark(row, "alarm", shown.alarm !== "");
    setText(own.alarm, shown.alarm); // read at once by a screen reader, once
    mark(own.status, "level", shown.level);
    setText(own.status, shown.status);
    setText(own.doing, shown.doing);
    setText(own.where, why || whereText(robot.state.location, map.places));
    setText(own.driver, shown.driver);
    setText(own.battery, shown.battery);
    const list = why ? this.#parts["rest-list"] : map.list;
    if (row.parentElement !== list) list.append(row);
    if (!why) drawn.get(map).push({ name, address, ...robot.state });
  }
}

function linkIn(row) {
  const { textContent: name, href: address } = row.querySelector("h3 a");
  return { name, address };
}

const root = document.querySelector("[data-page=plan]");
if (root) {
  const page = new PlanPage(root);
  window.addEventListener("pagehide", () => page.close());
  window.addEventListener("pageshow", ({ persisted }) => persisted && location.reload());
}
