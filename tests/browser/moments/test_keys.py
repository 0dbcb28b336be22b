"""The driving page by keys alone: the stop and control come first, and the palette finds the rest."""

from __future__ import annotations

import dataclasses
from typing import Any

from playwright.sync_api import expect

from tests.browser.moments.driving_page import DrivingPage
from tests.browser.moments.scenes import FREE, Moment

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
