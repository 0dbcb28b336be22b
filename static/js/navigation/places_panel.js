/** The list of places over the map: people send the robot to a place; supervisors and staff change places. */

import { whyNotNow } from "../control/lease.js";
import { closable } from "../lib/dialog.js";
import { dim, make, makeButton, setText, setTextOrHide, show } from "../lib/dom.js";
import { question } from "../lib/question.js";
import {
  addPlace,
  changePlace,
  deletePlace,
  exportAddress,
  importPlaces,
  nameMap,
} from "./places_api.js";

export class PlacesPanel {
  #parts;
  #page;
  #map = null;
  #earlier = [];
  #asked = null; // the dialog for a name that is open, or was last: {title, name, yes, remove}
  #deletes; // the question before a place is deleted
  #remove; // deletes the place that the question names
  #mayAct = null;
  #listening = new AbortController();

  /**
   * @param {Record<string, HTMLElement>} parts
   * @param {{go: (place: object) => void, choose: () => void, here: () => ?object, changed: () => void,
   *   notify: (notice: object) => void}} page `choose`: the next press on the map chooses a point; `here`:
   *   the robot's pose
   */
  constructor(parts, page) {
    this.#parts = parts;
    this.#page = page;
    const { signal } = this.#listening;
    const on = (part, act) => parts[part].addEventListener("click", act, { signal });
    on("map-places", () => this.open(parts.places.hidden));
    on("place-add", () => {
      this.open(false);
      page.choose();
    });
    on("place-here", () => this.#addHere());
    on("map-name", () => this.#askMapName());
    on("places-import", () => parts["places-file"].click());
    on("place-delete", () => this.#askDelete());
    parts["places-file"].addEventListener("change", () => this.#import(), { signal });
    parts["place-form"].addEventListener("submit", (event) => this.#named(event), { signal });
    parts.places.addEventListener("keydown", (event) => this.#typed(event), { signal });
    closable(parts["place-dialog"], signal);
    this.#deletes = question(parts["place-delete-dialog"], () => this.#delete());
  }

  close() {
    this.#listening.abort();
    this.#parts["place-dialog"].close();
    this.#deletes.close();
  }

  open(opens) {
    show(this.#parts.places, opens);
    this.#parts["map-places"].setAttribute("aria-expanded", String(opens));
  }

  set mayAct(may) {
    this.#mayAct = may;
    for (const button of this.#parts["places-list"].querySelectorAll(".place-go"))
      dim(button, !may, whyNotNow());
  }

  /**
   * @param {?object} map as the API describes it
   * @param {object[]} earlier maps of the robot that have places
   */
  show(map, earlier) {
    if (JSON.stringify([map, earlier]) === JSON.stringify([this.#map, this.#earlier])) return;
    this.#map = map;
    this.#earlier = earlier;
    const places = map?.places ?? [];
    setText(this.#parts["places-title"], titleOf(map));
    setTextOrHide(this.#parts["places-none"], places.length > 0 ? "" : noneText(map, earlier));
    this.#list(places);
    this.#parts["places-earlier"].replaceChildren(
      ...(places.length > 0 ? [] : earlier.map((one) => make("li", { children: [fileLink(one)] }))),
    );
    show(this.#parts["places-change"], map?.changeable ?? false);
    if (map) this.#parts["places-export"].href = exportAddress(map);
    this.mayAct = this.#mayAct;
  }

  /**
   * Ask for the name of a point that was chosen on the map.
   * @param {{x: number, y: number, heading: number}} pose
   */
  add(pose) {
    const map = this.#map;
    this.#ask({
      title: gettext("Add this place"),
      name: "",
      yes: async (name) => {
        await addPlace(map, { name, ...pose });
        return interpolate(gettext("The place “%s” is on the map."), [name]);
      },
    });
  }

  /** Lists places. The focus stays on its place: if nothing has the focus, letter keys drive the robot. */
  #list(places) {
    const list = this.#parts["places-list"];
    const focused = list.contains(document.activeElement) ? document.activeElement : null;
    const { number } = focused?.closest("li").dataset ?? {};
    const at = focused ? [...focused.parentElement.children].indexOf(focused) : 0;
    list.replaceChildren(...places.map((place) => this.#row(place)));
    if (!focused) return;
    const row = list.querySelector(`[data-number="${number}"]`);
    (row?.children[at] ?? this.#parts["map-places"]).focus();
  }

  #row(place) {
    const go = makeButton({ className: "button place-go", text: place.name }, () =>
      this.#page.go(place),
    );
    const children = [go];
    if (this.#map.changeable) {
      const change = makeButton({ className: "button", text: gettext("Change") }, () =>
        this.#change(place),
      );
      change.append(make("span", { className: "only-read", text: ` ${place.name}` }));
      children.push(change);
    }
    return make("li", { data: { number: place.number }, children });
  }

  #change(place) {
    const map = this.#map;
    this.#ask({
      title: interpolate(gettext("Change “%s”"), [place.name]),
      name: place.name,
      yes: async (name) => {
        await changePlace(map, place, { name });
        return interpolate(gettext("The place is now “%s”."), [name]);
      },
      remove: async () => {
        await deletePlace(map, place);
        return interpolate(gettext("The place “%s” was deleted."), [place.name]);
      },
    });
  }

  #addHere() {
    const here = this.#page.here();
    if (here === null) return this.#notify("info", gettext("The robot does not know where it is."));
    this.add(here);
  }

  #askMapName() {
    const map = this.#map;
    this.#ask({
      title: gettext("Name of this map"),
      name: map.name,
      yes: async (name) => {
        await nameMap(map, name);
        return interpolate(gettext("The map is now “%s”."), [name]);
      },
    });
  }

  #askDelete() {
    const { name, remove } = this.#asked;
    this.#remove = remove;
    this.#parts["place-dialog"].close();
    setText(
      this.#parts["place-delete-title"],
      interpolate(gettext("Delete the place “%s”?"), [name]),
    );
    this.#deletes.ask();
  }

  async #delete() {
    try {
      this.#notify("success", await this.#remove());
    } catch (error) {
      this.#notify("error", error.message);
    }
    this.#page.changed();
  }

  // --- dialog and file -----------------------------------------------------------------------------

  #ask(asked) {
    this.#asked = asked;
    setText(this.#parts["place-dialog-title"], asked.title);
    setTextOrHide(this.#parts["place-refused"], "");
    show(this.#parts["place-delete"], "remove" in asked);
    this.#parts["place-name"].value = asked.name;
    this.#parts["place-dialog"].show();
    this.#parts["place-name"].focus();
  }

  #named(event) {
    event.preventDefault();
    const name = this.#parts["place-name"].value.trim();
    this.#answered((asked) => asked.yes(name));
  }

  /** Run an action of the dialog; after a refusal the dialog stays open and shows the reason. */
  async #answered(act) {
    const asked = this.#asked;
    if (!asked || !act) return;
    try {
      this.#notify("success", await act(asked));
      if (this.#asked === asked) this.#parts["place-dialog"].close();
    } catch (error) {
      setTextOrHide(this.#parts["place-refused"], error.message);
    }
    this.#page.changed();
  }

  async #import() {
    const { files } = this.#parts["places-file"];
    if (files.length === 0) return;
    try {
      const done = await importPlaces(this.#map, await textOf(files[0]));
      const text = gettext("Places of the file: %s added, %s moved, %s already there.");
      this.#notify("success", interpolate(text, [done.added, done.changed, done.unchanged]));
    } catch (error) {
      this.#notify("error", error.message);
    }
    this.#parts["places-file"].value = "";
    this.#page.changed();
  }

  #typed(event) {
    if (event.key !== "Escape") return;
    this.open(false);
    this.#parts["map-places"].focus();
  }

  #notify(level, text) {
    this.#page.notify({ level, code: "places", text });
  }
}

function titleOf(map) {
  return map?.name
    ? interpolate(gettext("Places on the map “%s”"), [map.name])
    : gettext("Places on this map");
}

/** Return the reason why the list is empty. */
function noneText(map, earlier) {
  if (map === null) return gettext("There is no map yet, and so no place.");
  if (earlier.length > 0)
    return gettext(
      "This map is new: it has no places. Places of an earlier map are not copied: their positions may be wrong here. Their files:",
    );
  return map.changeable
    ? gettext("This map has no places yet. Add the first one.")
    : gettext("This map has no places yet. Supervisors add them.");
}

function fileLink(map) {
  const text = ngettext("%s, %s place", "%s, %s places", map.places.length);
  const name = map.name || gettext("map without a name");
  const link = make("a", { text: interpolate(text, [name, map.places.length]) });
  link.href = exportAddress(map);
  link.download = "";
  return link;
}

/** Return the text of a file. `File.text()` would replace each letter of another encoding, without an error. */
async function textOf(file) {
  const bytes = await file.arrayBuffer();
  try {
    return new TextDecoder("utf-8", { fatal: true }).decode(bytes);
  } catch {
    throw new Error(gettext("This file is not UTF-8 text. Save it as CSV UTF-8."));
  }
}
