"""The driving page by keys alone: the stop and control come first, and the palette finds the rest."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

import pytest
from playwright.sync_api import expect

from tests.browser.moments.driving_page import DrivingPage
from tests.browser.moments.scenes import FREE, MOMENTS, Moment
from tests.browser.moments.test_moments import COVERED

IN_CONTROL = Moment("keys")


def heard(driving: DrivingPage, *kinds: str) -> list[dict[str, Any]]:
    return [message for message in driving.heard if message["t"] in kinds]


def test_the_stop_and_control_come_first(driving: DrivingPage) -> None:
    driving.show(dataclasses.replace(IN_CONTROL, control=FREE))
    page = driving.page
    page.keyboard.press("t")
    page.keyboard.press("Tab")
    expect(page.locator(".stop-button")).to_be_focused()
    page.keyboard.press("Tab")
    expect(page.get_by_role("button", name="Take control", exact=True)).to_be_focused()
    page.keyboard.press("Enter")
    page.keyboard.press("Shift+Tab")
    page.keyboard.press("Enter")
    page.wait_for_function("document.querySelector('.stop-state').textContent")
    assert [message["t"] for message in heard(driving, "take", "stop")] == ["take", "take", "stop"]
    assert driving.complaints == []


@pytest.mark.parametrize(("width", "height"), [(320, 256), (844, 390)])
def test_the_other_reasons_open_and_close(driving: DrivingPage, width: int, height: int) -> None:
    driving.show(next(moment for moment in MOMENTS if moment.name == "moves although stopped"))
    page = driving.page
    page.set_viewport_size({"width": width, "height": height})
    more, details = page.get_by_role("button", name="See all 2 reasons"), page.locator("#details")
    close = details.get_by_role("button", name="Close")
    other = details.locator("[data-part=reasons-now] li").nth(1)

    def by_keys() -> None:
        more.press("Enter")
        for key in ("Tab", "PageDown") if height < 300 else ():  # else it is in sight at once
            page.keyboard.press(key)

    def by_finger() -> None:
        more.click()
        other.scroll_into_view_if_needed()

    def leave() -> None:
        page.keyboard.press("Escape")

    for opens, closes in ((by_finger, close.click), (by_keys, leave)):
        opens()
        expect(other).to_be_in_viewport()
        assert not [line for line in page.evaluate(COVERED) if line.startswith("stop")]
        closes()
        expect(details).to_be_hidden()
        expect(more).to_be_focused()
    assert driving.complaints == []


def test_nothing_drives_beside_an_open_dialog(driving: DrivingPage) -> None:
    driving.show(IN_CONTROL)
    page = driving.page
    page.set_viewport_size({"width": 1440, "height": 900})
    for opener in ("[data-part=keys-open]", "[data-part=log-open]"):
        page.locator(".menu summary").click()
        page.locator(opener).click()
        page.locator("dialog[open]").wait_for()
        page.locator(".driving h1").click(force=True)  # beside the dialog, which stays open
        page.keyboard.press("w", delay=200)
        page.locator("[data-part=zone]").hover(position={"x": 60, "y": 60})
        page.mouse.down()
        page.mouse.up()
        expect(page.get_by_text("Close the dialog first").first).to_be_visible()
        assert all(message["x"] == message["w"] == 0 for message in heard(driving, "drive"))
        page.locator("dialog[open] [data-close]").click()
    page.locator(".driving h1").click()
    page.keyboard.press("w", delay=200)
    assert any(message["x"] > 0 for message in heard(driving, "drive"))
    page.locator(".menu summary").click()
    page.locator("[data-part=keys-open]").click()
    page.locator(".driving h1").click(force=True)
    page.keyboard.press("Space")
    page.wait_for_function("document.querySelector('.stop-state').textContent")
    assert heard(driving, "stop")
    assert driving.complaints == []


@pytest.mark.parametrize(("part", "offered"), [("picture", 2), ("camera-floor", 3)])
def test_keys_point_at_the_floor(driving: DrivingPage, part: str, offered: int) -> None:
    driving.show(IN_CONTROL)
    page = driving.page
    picture, go = page.locator(f"[data-part={part}]"), page.get_by_role("button", name="Drive there")
    picture.focus()
    for key in ("Enter", "ArrowDown", "w", "ArrowLeft"):
        page.keyboard.press(key, delay=100)
    expect(page.locator("[data-part=point-words]")).to_have_text(re.compile("m ahead, .* m to the left"))
    page.keyboard.press("Enter")
    expect(go).to_be_focused()
    expect(go).to_have_accessible_description(re.compile("m away|Blocked|Too far|No room"))
    expect(page.locator("[data-part=there-offer] button:visible")).to_have_count(offered)
    page.keyboard.press("Escape")
    expect(go).to_be_hidden()
    expect(picture).to_be_focused()
    assert all(message["x"] == message["w"] == 0 for message in heard(driving, "drive"))
    assert driving.complaints == []


def test_the_palette_plays_and_nothing_drives(driving: DrivingPage) -> None:
    driving.show(IN_CONTROL)
    page = driving.page
    page.keyboard.press("w", delay=200)
    assert any(message["x"] > 0 for message in heard(driving, "drive"))
    driving.heard.clear()
    page.keyboard.press("Control+k")
    search = page.get_by_role("combobox", name="Search motions, phrases, places, robots and pages")
    expect(search).to_be_focused()
    expect(page.get_by_role("option", name="TIAGo Nine")).to_be_visible()
    search.press_sequentially("wave")
    expect(page.get_by_role("option")).to_have_count(1)
    page.keyboard.press("Enter")
    expect(search).to_be_hidden()
    played = heard(driving, "play")
    assert [message["motion"] for message in played] == ["wave"]
    assert played[0]["fence"] == IN_CONTROL.control.fence
    assert all(message["x"] == message["w"] == 0 for message in heard(driving, "drive"))
    assert driving.complaints == []
