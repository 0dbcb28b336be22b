"""A course in a real browser: made with a CSV file, joined by link; a qualification granted and taken away."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from uuid import uuid4

from playwright.sync_api import expect

from tests.browser.people import Person

Arrive = Callable[..., Person]
ROBOT = "tiago-2"
CSV = "Name;Nr;E-Mail\nJürgen Größe;7;{0}@example.org\nBob;8;bob(at)example.org\n"


def test_a_course_from_csv_to_the_wheel(person: Arrive, induction: str) -> None:
    staff, operator = person("staff"), person("operator")
    page, name = staff.page, f"Course {uuid4().hex[:6]}"
    staff.open("/courses/new/")
    page.get_by_label("Name", exact=True).fill(name)
    page.get_by_label("Last day").fill(f"{datetime.now(UTC) + timedelta(days=9):%Y-%m-%d}")
    page.get_by_label("TIAGo Two").check()
    content = CSV.format(uuid4().hex[:6]).encode("latin-1")
    file = {"name": "class.csv", "mimeType": "text/csv", "buffer": content}
    page.get_by_label("or a file (CSV").set_input_files(files=[file])  # type: ignore[list-item]
    page.get_by_role("button", name="Make the course").click()
    expect(page.get_by_role("alert")).to_contain_text("1 line is left out")
    expect(page.get_by_role("row", name="3 Left out:")).to_contain_text("bob(at)example.org")
    page.get_by_role("button", name="Make the course with 1 person").first.click()
    expect(page.get_by_role("heading", name=name)).to_be_visible()
    expect(page.get_by_role("checkbox", name="Jürgen Größe")).to_be_visible()

    page.get_by_role("button", name="Make a link").click()
    link = page.locator(".link code").inner_text()
    operator.page.goto(link)
    operator.page.get_by_role("button", name="Join").click()
    expect(operator.page.get_by_text(f"operator by course {name}")).to_be_visible()
    expect(operator.page.get_by_text(f"missing: {induction} (Every Monday.)")).to_be_visible()

    page.get_by_role("link", name="Back").click()
    page.get_by_label("Everybody in the course").check()
    page.get_by_role("button", name="Grant").click()
    expect(page.get_by_text("2 people were granted")).to_be_visible()
    operator.take(ROBOT)
    page.get_by_label("Everybody in the course").check()
    page.get_by_role("button", name="Revoke the qualification").click()
    operator.until(lambda: operator.control["state"] != "yours", "control to end")
    expect(operator.part("why")).to_contain_text(induction)
    page.get_by_role("button", name="Archive").click()
    expect(page.get_by_text("it gives nobody a role")).to_be_visible()
