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
