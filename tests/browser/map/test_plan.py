"""The fleet map: one page with all robots of a map that a person may see, live."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import pytest
from playwright.sync_api import expect

from tests.browser.people import PATIENCE_S, Person
from tests.browser.test_pages import axe_accepts

Arrive = Callable[..., Person]
pytestmark = pytest.mark.usefixtures("tiago_one")
TRIES = 5


def sent_to(operator: Person, name: str) -> None:
    """Choose a place of the list; again if the robot refuses: on a busy computer sensor data may be late."""
    choice = operator.part("places-list").get_by_role("button", name=name, exact=True)
    for _ in range(TRIES):
        if not choice.is_visible():
            operator.part("map-places").click()
        choice.click()
        with suppress(AssertionError):
            operator.until(
                lambda: operator.state.get("going"), f"the drive to {name}", timeout_s=PATIENCE_S / TRIES
            )
            return
    raise AssertionError(f"the robot was not sent to {name}")


def test_the_plan_shows_robots_on_their_map_who_drives_and_where_to(person: Arrive) -> None:
    operator, staff = person("operator", apart=True), person("staff")
    staff.open("/")
    staff.page.get_by_role("link", name="Fleet map").click()
    on_map = staff.page.locator(".plan-map")
    expect(on_map.get_by_role("heading", name="Office")).to_be_visible()
    one, two = (on_map.locator(f"[data-robot={slug}]") for slug in ("tiago-1", "tiago-2"))
    expect(one).to_be_visible()
    expect(two.locator("[data-part=driver]")).to_have_text("Nobody")
    expect(two.locator("[data-part=battery]")).to_contain_text("%")
    expect(staff.part("rest")).to_be_hidden()

    operator.take("tiago-2")
    expect(two.locator("[data-part=driver]")).to_have_text("Operator")
    operator.fold_arm()
    operator.part("map-open").click()
    sent_to(operator, "meeting room")
    expect(two.locator("[data-part=doing]")).to_have_text("Drives to “meeting room”, for Operator")
    operator.part("going-cancel").click()
    operator.until(lambda: not operator.state.get("going"), "the end of the drive")
    operator.until_still()
    operator.release()

    two.get_by_role("link", name="TIAGo Two").click()
    staff.page.wait_for_url("**/robots/tiago-2/")


@pytest.mark.parametrize(("width", "height"), [(360, 640), (844, 390), (1440, 900)])
def test_axe_accepts_the_plan_which_fits_the_screen(person: Arrive, width: int, height: int) -> None:
    observer = person("observer", width=width, height=height)
    observer.open("/plan/")
    expect(observer.page.locator(".plan-map [data-robot=tiago-1] [data-part=where]")).not_to_be_empty()
    axe_accepts(observer, "fleet map")
    assert observer.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
