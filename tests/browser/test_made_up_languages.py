"""Pages in two made-up languages: one has words that are 40 % longer, one is written from right to left."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.browser.people import MADE_UP_LANGUAGE, Person
from tests.browser.test_pages import PAGES, SIZES

TABS = [f"/robots/tiago-2/#{name}" for name in ("drive", "motions", "speech", "topics")]

# Texts that are cut off, that reach out of their button or card, or that are beside the window.
UNREADABLE = """() => {
  const BOXES = "button, .button, .toggle, .badge, .card, .fact, td";
  const reachesOut = (text, box) =>
    text.left < box.left - 2 || text.right > box.right + 2 || text.top < box.top - 4 || text.bottom > box.bottom + 4;
  const isUnreadable = (place, element) => {
    for (let box = element; box !== document.body; box = box.parentElement) {
      const style = getComputedStyle(box);
      if (/auto|scroll/.test(style.overflow) || style.textOverflow === "ellipsis") return false;
      if (style.webkitLineClamp !== "none") return false;
      if (style.clipPath !== "none" || style.clip !== "auto") return false; // only for screen readers
      const holds = style.overflow === "hidden" || box.matches(BOXES);
      if (holds && reachesOut(place, box.getBoundingClientRect())) return true;
    }
    return place.left < -1 || place.right > innerWidth + 1;
  };
  for (const status of document.querySelectorAll(".fact[data-part=status]"))
    status.textContent = gettext("Waiting for the robot"); // long words, whatever the robots do now
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const found = new Set();
  while (texts.nextNode()) {
    const { parentElement: element, data } = texts.currentNode;
    if (!data.trim() || element.closest("script, style, svg, option, .skip")) continue;
    if (!element.checkVisibility({ visibilityProperty: true })) continue;
    const range = document.createRange();
    range.selectNodeContents(texts.currentNode);
    if ([...range.getClientRects()].some((place) => isUnreadable(place, element))) found.add(data.trim());
  }
  return [...found];
}"""


@pytest.mark.parametrize("language", ["longer", "mirrored"])
def test_every_page_has_room_for_a_made_up_language(person: Callable[..., Person], language: str) -> None:
    page = (staff := person("staff", apart=True)).page
    page.add_init_script(
        f"const speak = {MADE_UP_LANGUAGE};"
        f"document.addEventListener('readystatechange', () => speak('{language}'), {{ once: true }});"
    )
    wrong: list[tuple[str, int, list[str]]] = []
    for path in [*PAGES, *TABS]:
        if language == "mirrored" and path.startswith("/admin/"):
            continue  # only the server adds the admin's own style sheets for this direction
        staff.open(path)
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            unreadable = page.evaluate(UNREADABLE)
            if unreadable or page.evaluate("document.scrollingElement.scrollWidth") != width:
                wrong.append((path, width, unreadable))
    assert wrong == []
