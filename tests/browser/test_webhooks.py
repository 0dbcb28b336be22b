"""A webhook in a real browser and with real housekeeping: made, tested, its answer read, deleted."""

from __future__ import annotations

import re
from collections.abc import Callable
from uuid import uuid4

from playwright.sync_api import expect

from tests.browser.people import Person
from tests.browser.test_pages import axe_accepts, found_by_axe


def test_a_webhook_that_leads_into_this_computer_says_so(person: Callable[..., Person]) -> None:
    staff, name = person("staff", width=360, height=640), f"CI {uuid4().hex[:6]}"
    page = staff.page
    staff.open("/webhooks/")
    page.get_by_role("link", name="New webhook").click()
    page.get_by_label("Name").fill(name)
    page.get_by_label("Address").fill(
        "https://localhost:1/a-rather-long-path/of-a-receiver/that-has-no-blanks?token=x"
    )
    for box in ("Stops", "Ends of speech", "TIAGo Two"):
        page.get_by_label(box).check()
    assert found_by_axe(staff) == []
    page.get_by_role("button", name="Make the webhook").click()
    expect(page.get_by_label("Secret")).to_have_value(re.compile(r"whsec_.{44}"))
    assert found_by_axe(staff) == []
    page.get_by_role("link", name="Go on").click()
    page.get_by_role("button", name="Send a test").click()
    expect(
        page.get_by_text("The test is on its way.")
    ).to_be_visible()  # the form leads to another page, which can be loaded again

    def answered() -> bool:
        page.goto(page.url)
        return page.get_by_text("in a private or reserved network").count() > 0

    staff.until(answered, "the answer of housekeeping")
    expect(page.get_by_text("waiting until")).to_be_visible()
    axe_accepts(staff, "webhook")
    assert page.evaluate("document.scrollingElement.scrollWidth") == 360
    page.get_by_text("Delete", exact=True).click()
    page.get_by_role("button", name="Delete the webhook").click()
    expect(page.get_by_text(f"{name} is deleted.")).to_be_visible()
