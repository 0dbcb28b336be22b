"""Tokens in a real browser: made, copied, listed and ended, at every window size."""

from __future__ import annotations

import urllib.request
from collections.abc import Callable
from uuid import uuid4

import pytest
from playwright.sync_api import expect

from tests.browser.people import Person
from tests.browser.test_pages import SIZES, axe_accepts

Arrive = Callable[..., Person]


def looked_at(person: Person) -> None:
    """Check the page: no complaint by axe, light and dark; at no size anything wider than the window."""
    axe_accepts(person, "tokens")
    for width, height in SIZES:
        person.page.set_viewport_size({"width": width, "height": height})
        assert person.page.evaluate("document.documentElement.scrollWidth <= innerWidth"), width


def show_that_it_is_you(person: Person) -> None:
    """Type the password if the page asks. All browsers of a role share a sign-in: another test may have typed it."""
    password = person.page.get_by_label("Password", exact=True)
    password.or_(person.page.get_by_label("Name of the program")).wait_for()
    if password.count():
        password.fill(person.account.password)
        person.page.get_by_role("button", name="Confirm").click()


@pytest.mark.parametrize("clipboard", [True, False], ids=["clipboard", "none"])
def test_a_token_is_made_copied_used_and_ended(clipboard: bool, person: Arrive) -> None:
    operator, name = person("operator", apart=True), f"night-{uuid4().hex[:6]}"
    page = operator.page
    if clipboard:
        operator.context.grant_permissions(["clipboard-read", "clipboard-write"])
    else:  # a page by plain HTTP from another computer has no clipboard
        page.add_init_script("Object.defineProperty(navigator, 'clipboard', {value: undefined})")
    operator.open("/accounts/")
    page.get_by_role("link", name="Show Tokens").click()
    page.get_by_role("link", name="New token").click()
    show_that_it_is_you(operator)
    page.get_by_text("Only some robots").click()
    looked_at(operator)
    page.get_by_label("Name of the program").fill(name)
    page.get_by_label("take control and drive").check()
    page.get_by_label("TIAGo One").check()
    page.get_by_role("button", name="Make token").click()
    looked_at(operator)
    text = page.get_by_label("Token", exact=True).input_value()
    page.get_by_role("button", name="Copy").click()
    if clipboard:
        expect(page.get_by_role("button", name="Copied")).to_be_visible()
        assert page.evaluate("navigator.clipboard.readText()") == text
    else:
        expect(page.get_by_role("button", name="Ctrl+C")).to_be_visible()
        assert page.evaluate("getSelection().toString()") == text
    request = urllib.request.Request(  # noqa: S310
        f"{operator.stack.url}/api/v1/robots", headers={"Authorization": f"Bearer {text}"}
    )
    with urllib.request.urlopen(request) as answer:  # noqa: S310
        assert b"tiago-1" in answer.read()

    page.get_by_role("link", name="Done").click()
    row = page.get_by_role("listitem").filter(has_text=name)
    expect(row).to_contain_text("Only: TIAGo One.")
    expect(row).to_contain_text("Last used")
    row.get_by_text("End…").click()
    looked_at(operator)
    row.get_by_role("button", name=f"End this token {name}").click()
    expect(page.locator(".messages")).to_contain_text(f"“{name}” is ended")
    expect(row).to_have_count(0)


def test_staff_make_a_service_account_and_its_token(person: Arrive) -> None:
    staff, name = person("staff", apart=True), f"Night tests {uuid4().hex[:6]}"
    page = staff.page
    staff.open("/courses/")
    page.get_by_role("link", name="Service accounts").click()
    page.get_by_label("Name", exact=True).fill(name)
    page.get_by_label("Project").fill("Grasping")
    page.get_by_role("button", name="Make account").click()
    looked_at(staff)
    page.get_by_role("link", name="New token").click()
    show_that_it_is_you(staff)
    page.get_by_label("Name of the program").fill("nightly")
    page.get_by_role("button", name="Make token").click()
    page.get_by_role("link", name="Done").click()
    looked_at(staff)
    staff.open("/service-accounts/")
    expect(page.get_by_role("listitem").filter(has_text=name)).to_contain_text("1 token")
    looked_at(staff)
