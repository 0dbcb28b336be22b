"""At the moments that matter, nothing on the driving page covers what a person needs."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.browser.moments.driving_page import DrivingPage
from tests.browser.moments.scenes import MOMENTS, Moment

SIZES = [(360, 640), (390, 844), (844, 390), (320, 256), (1440, 900)]  # the last one also as a whole screen
# Which element lies uppermost at points of what a person needs? An element that paints nothing covers nothing.
COVERED = """() => {
  const paints = (element) => {
    const { backgroundColor, backgroundImage } = getComputedStyle(element);
    const isText = [...element.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
    return !/, 0\\)$|^transparent$/.test(backgroundColor) || backgroundImage !== "none" || isText
      || ["CANVAS", "BUTTON", "svg", "IMG"].includes(element.tagName);
  };
  const part = (selector) => document.querySelector(selector);
  const needed = {
    stop: [part(".stop-button"), "box"],
    reason: [part("[data-part=reason]"), "box"],
    stick: [part("[data-part=zone]"), "disc"],
    take: [part("[data-action=take]"), "box"],
    robot: [part(".picture"), [0.5, 0.6]],
    camera: [part("[data-part=camera]"), [0.5, 0.5]],
  };
  const wrong = [];
  for (const [name, [element, shape]] of Object.entries(needed)) {
    if (!element?.checkVisibility()) continue;
    const { left, top: y0, width, height } = element.getBoundingClientRect();
    if (left < -1 || y0 < -1 || left + width > innerWidth + 1 || y0 + height > innerHeight + 1)
      wrong.push(`${name} is partly outside`);
    const shares = { box: [[.5, .5], [.06, .1], [.94, .1], [.06, .9], [.94, .9]],
      disc: [[.5, .5], [.2, .5], [.8, .5], [.5, .2], [.5, .8]] }[shape] ?? [shape];
    for (const [right, down] of shares) {
      const there = document.elementsFromPoint(left + right * width, y0 + down * height);
      const found = there.find((one) => element.contains(one) || paints(one));
      if (!element.contains(found)) wrong.push(`${name} is covered by ${found?.className || found?.tagName}`);
    }
  }
  const { scrollWidth } = document.scrollingElement;
  if (scrollWidth > innerWidth) wrong.push(`the page is ${scrollWidth} wide`);
  return wrong;
}"""
SHOTS = os.environ.get("MOMENT_SHOTS")  # a directory for pictures of all moments, light and dark


@pytest.mark.parametrize("moment", MOMENTS, ids=lambda moment: moment.name.replace(" ", "-"))
def test_nothing_covers_what_matters(driving: DrivingPage, moment: Moment) -> None:
    page = driving.page
    driving.show(moment)
    page.add_style_tag(content="* { pointer-events: auto !important }")  # what takes no pointer covers, too
    wrong = {}

    def look(name: str) -> None:
        page.wait_for_timeout(150)  # the page follows its size in the next frames
        if found := page.evaluate(COVERED):
            wrong[name] = sorted(set(found))
        for theme in ("light", "dark") if SHOTS else ():
            page.emulate_media(color_scheme=theme)  # type: ignore[arg-type]
            page.screenshot(path=Path(SHOTS or "") / f"{moment.name.replace(' ', '-')}-{name}-{theme}.png")

    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        look(f"{width}x{height}")
    page.evaluate("document.querySelector('main').requestFullscreen()")
    page.locator(".control[data-full]").wait_for()
    look("whole-screen")
    assert wrong == {}
    assert driving.complaints == []
