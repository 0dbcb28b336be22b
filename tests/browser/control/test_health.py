"""A robot whose parts get faults: fleet card, notice, header and details show them until they end."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import expect

from script.stack.stack import Stack
from tests.browser.people import Person, faults_of
from tests.browser.test_pages import found_by_axe, too_small

Arrive = Callable[..., Person]
ROBOT = "tiago-2"


@pytest.fixture
def faults(stack: Stack, tmp_path: Path) -> Iterator[Callable[[str], None]]:
    """``faults(names)`` sets the simulated robot's faults until the end of the test."""
    with faults_of(stack.robots[ROBOT], tmp_path) as begin:
        yield begin


def test_an_ill_part_is_on_card_and_page_with_its_time_and_told_once(
    person: Arrive, faults: Callable[[str], None]
) -> None:
    observer, staff = person("observer"), person("staff")
    staff.open("/")
    card = staff.page.locator(f"[data-robot={ROBOT}] [data-part=health]")
    expect(card).to_have_text(re.compile("All well \\(. parts\\), at most .. °C"))
    observer.watch(ROBOT)
    observer.until(lambda: (observer.state.get("health") or {}).get("level") == "ok", "a healthy robot")
    expect(observer.part("health-open")).to_be_hidden()

    faults("motor_hot,part_broken")
    expect(card).to_have_text(re.compile(r"Speakers: Amplifier does not answer, and 1 more \(since .+\)"))
    told = observer.page.locator(".notice", has_text="Speakers: Amplifier does not answer")
    expect(told.first).to_be_visible()
    observer.part("health-open").click()
    rows = observer.part("health-parts").locator("li")
    expect(rows).to_have_count(2)
    expect(rows.nth(0)).to_have_text(re.compile(r"Speakers: Amplifier does not answer \(since .+\)"))
    expect(rows.nth(1)).to_have_text(re.compile(r"Motors: left wheel: Too warm \(since .+\)"))
    expect(observer.part("temperatures")).to_contain_text("Motors: left wheel 84 °C")
    assert found_by_axe(observer) == []
    for width, height in ((360, 640), (844, 390)):
        phone = person("operator", width=width, height=height, touch=True, theme="dark")
        phone.watch(ROBOT)
        expect(phone.part("health-open")).to_be_visible()
        assert found_by_axe(phone) == []
        assert too_small(phone) == []

    faults("none")
    expect(card).to_have_text(re.compile("All well"))
    expect(rows).to_have_count(0)
