"""At the moments that matter, nothing on the driving page covers what a person needs."""

from __future__ import annotations

import json
import os
from pathlib import Path

import msgspec
import pytest
from playwright.sync_api import Page

from robots.shared.wire import Booked
from tests.browser.moments.driving_page import DrivingPage
from tests.browser.moments.scenes import MINE, MOMENTS, Moment
from tests.browser.people import MADE_UP_LANGUAGE
from tests.browser.test_pages import A_LONG_NAME, box_of, overlap

SIZES = [(360, 640), (390, 844), (844, 390), (320, 256), (1440, 900)]  # the last one also as a whole screen
USUAL = [SIZES[0], SIZES[-1]]
FURTHER = [size for size in SIZES if size not in USUAL]
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
    "robot on the map": [part(".map-canvas"), "mark"], // in the middle, because there is no map
  };
  for (const one of document.querySelectorAll(".picture-tools .button")) needed[one.textContent] = [one, "box"];
  const wrong = [];
  for (const [name, [element, shape]] of Object.entries(needed)) {
    if (!element?.checkVisibility()) continue;
    const { left, top: y0, width, height } = element.getBoundingClientRect();
    if (left < -1 || y0 < -1 || left + width > innerWidth + 1 || y0 + height > innerHeight + 1)
      wrong.push(`${name} is partly outside`);
    const shares = { box: [[.5, .5], [.06, .1], [.94, .1], [.06, .9], [.94, .9]],
      disc: [[.5, .5], [.2, .5], [.8, .5], [.5, .2], [.5, .8]],
      mark: [0, 10, -10].map((px) => [.5, .5 + px / height]) }[shape] ?? [shape];
    for (const [right, down] of shares) {
      const there = document.elementsFromPoint(left + right * width, y0 + down * height);
      const found = there.find((one) => element.contains(one) || paints(one));
      if (!element.contains(found)) wrong.push(`${name} is covered by ${found?.className || found?.tagName}`);
    }
  }
  const [strip] = needed.reason;
  if (strip.checkVisibility() && strip.dataset.level === "alarm") {
    const ordinary = parseFloat(getComputedStyle(strip).getPropertyValue("--reason"));
    const { bottom, height } = strip.getBoundingClientRect();
    if (height < 1.7 * ordinary) wrong.push("the alarm is no larger than another reason");
    if (part(".reason-title").getBoundingClientRect().bottom > bottom) wrong.push("the alarm is cut");
  }
  const { scrollWidth } = document.scrollingElement;
  if (scrollWidth > innerWidth) wrong.push(`the page is ${scrollWidth} wide`);
  return wrong;
}"""
# Resolved when the page has followed its size: observers and what they ask for come in the next frames.
FOLLOWED = """async () => {
  for (let frame = 0; frame < 4; frame++) await new Promise(requestAnimationFrame);
}"""
ALL_POINTED = "* { pointer-events: auto !important }"  # what takes no pointer covers, too
SHOTS = os.environ.get("MOMENT_SHOTS")  # a directory for pictures of all moments, light and dark


# Whether the words of a card with this selector are no taller than it.
WORDS_FIT = """(selector) => {
  const card = document.querySelector(selector);
  const words = document.createRange();
  words.selectNodeContents(card.querySelector("p"));
  return words.getBoundingClientRect().height <= card.clientHeight;
}"""


def covered(page: Page, name: str) -> list[str]:
    """Return what is covered in the page as it is now. `name`: of its pictures."""
    page.evaluate(FOLLOWED)
    for theme in ("light", "dark") if SHOTS else ():
        page.emulate_media(color_scheme=theme)  # type: ignore[arg-type]
        page.screenshot(path=Path(SHOTS or "") / f"{name.replace(' ', '-')}-{theme}.png")
    return sorted(set(page.evaluate(COVERED)))


@pytest.mark.parametrize("sizes", [USUAL, FURTHER], ids=["usual", "further"])
@pytest.mark.parametrize("moment", MOMENTS, ids=lambda moment: moment.name.replace(" ", "-"))
def test_nothing_covers_what_matters(
    driving: DrivingPage, moment: Moment, sizes: list[tuple[int, int]]
) -> None:
    page = driving.page
    driving.show(moment)
    page.add_style_tag(content=ALL_POINTED)
    wrong = {}
    for width, height in sizes:
        page.set_viewport_size({"width": width, "height": height})
        wrong[f"{width}x{height}"] = covered(page, f"{moment.name}-{width}x{height}")
    if sizes is USUAL:
        page.evaluate("document.querySelector('main').requestFullscreen()")
        page.locator(".control[data-full]").wait_for()
        wrong["whole screen"] = covered(page, f"{moment.name}-whole-screen")
    assert {size: found for size, found in wrong.items() if found} == {}
    assert driving.complaints == []


def test_nothing_covers_what_matters_beside_cells(driving: DrivingPage) -> None:
    page = driving.page
    page.set_viewport_size({"width": 1440, "height": 900})
    driving.show(next(moment for moment in MOMENTS if moment.name == "held before a wall"))
    page.add_style_tag(content=ALL_POINTED)
    page.locator("[data-part=arrange-open]").click()
    page.locator("[data-count='4']").click()
    page.locator("[data-at='2']").select_option("plot")
    page.locator("[data-part=plot-topic]").select_option("/odom")
    page.locator("[data-part=plot-field]").select_option("x")
    wrong = {}
    for lists, stick in [(True, True), (False, True), (False, False), (True, False)]:
        page.locator("[data-part=arrange-side]").set_checked(lists)
        page.locator("[data-part=arrange-stick]").set_checked(stick)
        page.locator("[data-part=arrange-close]").click()
        for width, height in [(1100, 640), (1440, 900)]:
            page.set_viewport_size({"width": width, "height": height})
            page.evaluate(FOLLOWED)
            cells = [box_of(cell) for cell in page.locator("[data-cell]").all()]
            assert len(cells) == 4
            assert all(cell["width"] >= 240.0 and cell["height"] >= 150.0 for cell in cells), cells
            hidden = "".join(f" no {name}" for name, on in [("lists", lists), ("stick", stick)] if not on)
            size = f"{width}x{height}{hidden}"
            wrong[size] = covered(page, f"four cells-{size}")
        page.locator("[data-part=arrange-open]").click()
    assert {size: found for size, found in wrong.items() if found} == {}
    assert driving.complaints == []


FREE = """selector => {
  const element = document.querySelector(selector), { left, top: y, width, height } = element.getBoundingClientRect();
  return element.contains(document.elementFromPoint(left + width / 2, y + height / 2)) && [left, y, width, height];
}"""


def test_a_reason_moves_no_list_and_covers_no_drawer(driving: DrivingPage) -> None:
    page = driving.page
    page.set_viewport_size({"width": 360, "height": 640})
    driving.show(next(moment for moment in MOMENTS if moment.name == "held before a wall"))
    reason = page.locator("[data-part=reason]")
    page.locator("[data-drawer-open=actions]").click()
    for shown in ("phrases", "motions"):
        assert page.evaluate(FREE, f".drawer-head [data-shows={shown}]"), shown
    page.evaluate("location.hash = 'motions'")
    reason.wait_for()
    with_reason = page.evaluate(FREE, ".motions .hit")
    reason.evaluate("element => { element.hidden = true }")
    assert with_reason and with_reason == page.evaluate(FREE, ".motions .hit")


LINES = """() => {
  const words = document.querySelector(".who-words"), { bottom } = words.getBoundingClientRect();
  const range = document.createRange();
  range.selectNodeContents(words);
  const lines = [...range.getClientRects()].filter(({ height }) => height);
  return {
    cut: lines.filter((line) => line.top < bottom - 1 && line.bottom > bottom + 1).length,
    hidden: lines.filter((line) => line.top >= bottom - 1).length,
  };
}"""


def test_long_words_about_control_have_whole_lines(driving: DrivingPage) -> None:
    page = driving.page
    page.set_viewport_size({"width": 360, "height": 640})
    next_booked = Booked(A_LONG_NAME, mine=False, seconds=240.0)
    driving.show(Moment("a slot", control=msgspec.structs.replace(MINE, next_booked=next_booked)))
    few = page.evaluate(LINES)
    if SHOTS:
        page.screenshot(path=Path(SHOTS) / "long words.png")
    assert few["cut"] == 0
    assert few["hidden"] > 0
    page.locator(".who-words").click()
    if SHOTS:
        page.screenshot(path=Path(SHOTS) / "long words opened.png")
    assert page.evaluate(LINES) == {"cut": 0, "hidden": 0}
    assert page.evaluate(FREE, ".who-words")
    page.locator("[data-part=camera]").click(position={"x": 20, "y": 60})
    assert page.evaluate(LINES) == few


def test_no_notice_covers_the_reason_on_a_tab(driving: DrivingPage) -> None:
    page = driving.page
    page.set_viewport_size({"width": 1440, "height": 900})
    driving.show(next(moment for moment in MOMENTS if moment.name == "stopped by another"))
    page.evaluate("location.hash = 'motions'")
    page.locator(".motions button.hit, .motions .hit button").first.click()
    page.locator(".notices .notice").first.wait_for()
    assert page.evaluate(FREE, "[data-part=reason-act]")


def test_the_words_of_each_hint_fit_their_card(driving: DrivingPage) -> None:
    page = driving.page
    newcomer = {"camera-view": "camera", "hints_seen operator": False}
    page.add_init_script(f"localStorage.setItem('fleet-console', '{json.dumps(newcomer)}')")
    driving.show(next(moment for moment in MOMENTS if moment.name == "ready"))
    for number in (1, 2, 3):
        page.get_by_text(f"{number} of 3").wait_for()
        # Not at 400 % zoom, which has no room for hints.
        for width, height in (*SIZES[:3], (1024, 700), (1100, 660), (1280, 656), SIZES[-1]):
            page.set_viewport_size({"width": width, "height": height})
            assert page.evaluate(WORDS_FIT, ".hint-card"), (number, width, height)
        page.locator("[data-part=hint-next]").click()


def test_nothing_beside_a_dialog_acts_except_the_stop(driving: DrivingPage) -> None:
    page = driving.page
    page.set_viewport_size({"width": 1440, "height": 900})
    driving.show(Moment("in control"))
    play, stop = page.get_by_role("button", name="Play Home"), page.locator(".stop-button")
    driving.heard.clear()
    page.keyboard.press("?")
    page.locator("[data-part=keys-dialog][open]").wait_for()
    for box in (box_of(play), box_of(stop)):
        page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.keyboard.press("?")
    page.locator("[data-part=keys-dialog]").wait_for(state="hidden")
    play.click()
    while not any(one["t"] == "play" for one in driving.heard):
        page.wait_for_timeout(20)
    assert [one["t"] for one in driving.heard if one["t"] in ("play", "stop")] == ["stop", "play"]


def test_no_button_covers_the_age_of_a_picture(driving: DrivingPage) -> None:
    page, age = driving.page, ".camera:not(.second) .camera-age"
    page.set_viewport_size({"width": 1280, "height": 656})
    driving.show(next(moment for moment in MOMENTS if moment.name == "console silent"))
    page.add_style_tag(content=ALL_POINTED)
    page.locator(age).wait_for()
    for tool in page.locator(".picture-tools .button:visible").all():
        assert not overlap(box_of(page.locator(age)), box_of(tool))
    page.set_viewport_size({"width": 1440, "height": 900})
    page.evaluate("location.hash = 'motions'")
    page.locator(age).wait_for()
    page.evaluate(MADE_UP_LANGUAGE, "longer")
    assert covered(page, "age on a tab") == []
    assert page.evaluate(FREE, age)
