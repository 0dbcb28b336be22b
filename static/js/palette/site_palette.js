/** The palette of all other pages: robots and pages. Loaded when a person first opens it. */

import { pages } from "./pages.js";
import { Palette } from "./palette.js";
import { robots } from "./robots.js";

let palette = null;

export function togglePalette() {
  palette ??= new Palette(document.body, gettext("Search robots and pages"), [robots, pages]);
  palette.toggle();
}
