"""From a teacher's CSV to a booking, in a real browser: induction, all refusals at once, the line, a live calendar."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from uuid import uuid4

import pytest
from playwright.sync_api import Browser, expect

from script.stack.stack import Account, Stack
from tests.browser.people import Person
from tests.browser.test_pages import axe_accepts_everywhere

Arrive = Callable[..., Person]
ROBOT = "TIAGo Two"
TOMORROW = datetime.now(UTC) + timedelta(days=1)


@pytest.fixture
def student(stack: Stack, browser: Browser) -> Iterator[Person]:
    """A new person at a browser. The course makes the account."""
    somebody = Person(stack, browser, "observer")
    name = f"stu-{uuid4().hex[:6]}@example.org"
    somebody.account = Account(name, "student", "a long walk on the beach")
    yield somebody
    somebody.leave()


@pytest.fixture
def course(person: Arrive, student: Person, induction: str) -> Iterator[str]:
    """A course on ROBOT from a CSV file with the student. It is archived after the test."""
    staff, name = person("staff"), f"Course {uuid4().hex[:6]}"
    page = staff.page
    page.goto(f"{student.stack.url}/courses/new/")
    page.get_by_label("Name", exact=True).fill(name)
    page.get_by_label("Last day").fill(f"{TOMORROW + timedelta(days=9):%Y-%m-%d}")
    page.get_by_label(ROBOT).check()
    content = f"Name;Nr;E-Mail\nStu Dent;7;{student.account.username}\n".encode("latin-1")
    file = {"name": "class.csv", "mimeType": "text/csv", "buffer": content}
    page.get_by_label("or a file (CSV").set_input_files(files=[file])  # type: ignore[list-item]
    page.get_by_role("button", name="Make the course").click()
    page.get_by_role("button", name="Make the course with 1 person").first.click()
    expect(page.get_by_role("checkbox", name="Stu Dent")).to_be_visible()
    address = page.url
    yield address
    page.goto(address)
    page.get_by_role("button", name="Archive").click()
    expect(page.get_by_role("heading", name="This takes time from 1 person")).to_be_visible()
    expect(page.locator(".losses")).to_contain_text("Stu Dent")
    axe_accepts_everywhere(staff, "who loses time")
    page.get_by_role("button", name="Do it").click()
    expect(page.get_by_text("it gives nobody a role")).to_be_visible()


def test_a_student_is_refused_waits_and_gets_the_slot(person: Arrive, student: Person, course: str) -> None:
    staff, owner = person("staff"), person("supervisor")
    set_password(staff, student, course)
    open_calendar(student)
    student.page.evaluate("document.body.dataset.sameDocument = '1'")
    event = student.page.locator(".ec-event", has_text="Supervisor")
    expect(event).to_have_count(0)
    book(owner, "12:00", "13:00", reason="An open day")  # without the induction
    expect(owner.page.get_by_text(re.compile("^Booked:"))).to_be_visible()
    expect(event).to_have_count(1)  # without a reload
    expect(student.page.locator("body[data-same-document]")).to_be_attached()

    book(student, "10:00", "16:00")
    refusals = student.page.locator(".refusals li")
    assert sorted(one.get_attribute("data-code") or "" for one in refusals.all()) == [
        "taken",
        "too_long",
        "unqualified",
    ]
    staff.page.goto(course)
    staff.page.get_by_label("Everybody in the course").check()
    staff.page.get_by_role("button", name="Grant").click()
    expect(staff.page.get_by_text("1 person was granted")).to_be_visible()
    book(student, "12:00", "13:00")
    expect(refusals).to_have_count(1)
    expect(refusals).to_contain_text("Supervisor has booked TIAGo Two")
    expect(student.page.locator(".alternatives a")).not_to_have_count(0)
    student.press("Join the waiting list")
    expect(student.page.get_by_role("region", name="Waiting list")).to_contain_text(f"{ROBOT}, ")

    owner.open("/bookings/mine/")
    cancel = owner.page.get_by_role("button", name=f"Cancel {ROBOT}")
    question = owner.page.get_by_role("dialog", name="Cancel this booking?")
    cancel.press("Enter")
    expect(question).to_contain_text(ROBOT)
    owner.page.keyboard.press("Escape")
    expect(question).to_be_hidden()
    cancel.press("Enter")
    owner.page.keyboard.press("Tab")  # from "Keep it" to the button that cancels
    owner.page.keyboard.press("Enter")
    expect(owner.page.get_by_text(f"Cancelled: {ROBOT}")).to_be_visible()
    accept = student.page.get_by_role("button", name=f"Accept {ROBOT}")
    student.until(lambda: reload(student) and accept.is_visible(), "the offer")
    expect(student.page.get_by_text(f"{ROBOT}: your turn")).to_be_visible()
    accept.click()
    expect(student.page.locator("dl.facts")).to_contain_text("Stu Dent")
    expect(student.page.locator("dl.facts")).to_contain_text("booked")
    open_calendar(student)
    expect(student.page.locator(".ec-event.mine")).to_have_count(1)


def set_password(staff: Person, student: Person, course: str) -> None:
    """Open the student's link from the sheet of the course: the demo has no mail server."""
    staff.page.goto(course)
    staff.page.get_by_role("button", name="Link to set a password: 1 person").click()
    expect(staff.page.get_by_role("img", name="QR code of the link of Stu Dent")).to_be_visible()
    student.page.goto(staff.page.locator(".slip-link").inner_text())
    for field in student.page.locator("input[type=password]").all():
        field.fill(student.account.password)
    student.page.locator("main form button").click()
    student.sign_in()


def book(somebody: Person, starts: str, ends: str, reason: str = "") -> None:
    """Fill in the form for ROBOT and tomorrow, and send it."""
    somebody.open("/bookings/new/")
    somebody.page.locator("select[name='robot']").select_option(label=ROBOT)
    somebody.page.get_by_label("From").fill(f"{TOMORROW:%Y-%m-%d}T{starts}")
    somebody.page.get_by_label("To", exact=True).fill(f"{TOMORROW:%Y-%m-%d}T{ends}")
    if reason:
        somebody.page.get_by_label("Reason").fill(reason)
    somebody.page.get_by_role("button", name="Book", exact=True).click()


def open_calendar(somebody: Person) -> None:
    """Open the calendar of tomorrow, and wait until its bookings are there."""
    somebody.open(f"/bookings/?day={TOMORROW:%Y-%m-%d}")
    expect(somebody.part("calendar").get_by_text(ROBOT)).to_be_visible()
    expect(somebody.part("calendar")).to_have_attribute("aria-busy", "false")


def reload(somebody: Person) -> bool:
    """Open the person's list again."""
    somebody.open("/bookings/mine/")
    return True
