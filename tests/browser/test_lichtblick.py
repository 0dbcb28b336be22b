"""*Open in Lichtblick*: a robot's topics in another tab, which can do nothing else."""

from __future__ import annotations

import re
from collections.abc import Callable

from playwright.sync_api import expect

from tests.browser.people import Person

Arrive = Callable[..., Person]
ROBOT = "tiago-2"
BLOCKED = ("api", "elsewhere", "control", "window", "frame", "worker")


def test_lichtblick_reads_the_robot_and_reaches_nothing_else(person: Arrive) -> None:
    observer = person("observer", apart=True)
    observer.watch(ROBOT)
    observer.page.locator(".menu summary").click()
    observer.page.get_by_role("button", name="Open in Lichtblick").first.click()
    dialog = observer.part("lichtblick-dialog")
    address = re.compile(rf"^ws://.+/foxglove/{ROBOT}\?ticket=.{{20,}}$")
    expect(observer.part("lichtblick-address")).to_have_value(address)
    with observer.page.context.expect_page() as opened:
        dialog.get_by_role("link", name="Open in a new tab").click()
    shown = opened.value.locator("body")
    expect(shown).to_have_attribute("data-message", "came")
    expect(shown).to_have_attribute("data-evaluated", "7")
    expect(shown).to_have_attribute("data-kept", "kept")
    for tried in BLOCKED:
        expect(shown).to_have_attribute(f"data-{tried}", "blocked")
    opened.value.close()


def test_tabs_on_a_phone_held_sideways_begin_below_the_header(person: Arrive) -> None:
    """In the centre the header lies on the camera's picture."""
    observer = person("observer", apart=True, width=844, height=390, touch=True)
    observer.watch(ROBOT)
    for tab in ("Topics", "Speech"):
        observer.page.get_by_role("tab", name=tab).click()
        header = observer.page.locator(".top").bounding_box()
        heading = observer.page.locator("main h2:visible").first.bounding_box()
        assert header and heading
        assert heading["y"] >= header["y"] + header["height"], tab
