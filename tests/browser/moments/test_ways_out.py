"""The button beside the reason does what it says, and a stick without control is answered."""

from __future__ import annotations

import dataclasses

from playwright.sync_api import expect

from tests.browser.moments.driving_page import DrivingPage
from tests.browser.moments.scenes import FREE, MOMENTS, Moment

HELD = next(moment for moment in MOMENTS if moment.name == "held before a wall")
PAD = """() => {
  const pad = { index: 0, id: "Pad", mapping: "standard", connected: true, axes: [0, 0, 0, 0], buttons: [] };
  navigator.getGamepads = () => [pad];
  dispatchEvent(Object.assign(new Event("gamepadconnected"), { gamepad: pad }));
  requestAnimationFrame(() => requestAnimationFrame(() => { pad.axes = [0, -1, 0, 0]; }));
}"""


def test_the_way_out_begins_with_the_stick_at_rest(driving: DrivingPage) -> None:
    driving.show(HELD)
    page = driving.page
    driving.heard.clear()
    page.keyboard.down("w")
    page.get_by_role("button", name="Back off", exact=True).click()
    expect(page.locator("[data-part=reason-more]")).to_have_text("See all 2")  # the key must be released
    heard = [message for message in driving.heard if message["t"] in ("drive", "drive_by")]
    at = [message["t"] for message in heard].index("drive_by")
    assert heard[at]["distance_m"] == -0.3
    assert max(message["x"] for message in heard[:at]) > 0
    assert {message["x"] for message in (heard[at - 1], *heard[at + 1 :])} == {0}
    assert driving.complaints == []


def test_a_gamepad_without_control_is_answered(driving: DrivingPage) -> None:
    driving.show(dataclasses.replace(Moment("pad"), control=FREE))
    driving.page.evaluate(PAD)
    expect(driving.page.locator("[data-part=reason-title]")).to_have_text(
        "Take control first: then you drive"
    )
    assert driving.complaints == []
