"""A lesson in real browsers: the teacher fills the line, the called student drives, the teacher skips the turn."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from uuid import uuid4

import pytest
from playwright.sync_api import expect

from script.stack.stack import Stack
from tests.browser.people import Person
from tests.browser.test_pages import found_by_axe

Arrive = Callable[..., Person]
ROBOT = "tiago-2"
SIZES = ((360, 640), (844, 390), (1440, 900))


@pytest.fixture
def lesson(stack: Stack) -> Iterator[str]:
    """The id of a lesson of staff that runs now, with turns of ten minutes; the operator is in the course."""
    with sqlite3.connect(stack.directory / "fleet.sqlite3", timeout=20) as database:

        def key(table: str, column: str, name: str) -> str:
            [found] = database.execute(f"SELECT id FROM {table} WHERE {column} = ?", [name]).fetchone()
            return str(found)

        now = datetime.now(UTC).replace(tzinfo=None)
        days = str(now.date() - timedelta(days=1)), str(now.date() + timedelta(days=30))
        course = database.execute(
            "INSERT INTO access_course (name, slug, role, starts_on, ends_on, archived, lessons_count)"
            " VALUES ('HRI 2026', 'hri-lesson', 'operator', ?, ?, 0, 'nobody')",
            days,
        ).lastrowid
        robot, staff = key("robots_robot", "slug", ROBOT), key("accounts_user", "username", "staff")
        database.execute(
            "INSERT INTO access_course_robots (course_id, robot_id) VALUES (?, ?)", [course, robot]
        )
        database.execute(
            "INSERT INTO access_enrolment (course_id, person_id, added_at, number) VALUES (?, ?, ?, '')",
            [course, key("accounts_user", "username", "operator"), str(now)],
        )
        booking, until = uuid4(), str(now + timedelta(hours=1))
        database.execute(
            "INSERT INTO bookings_booking (id, robot_id, person_id, course_id, starts_at, ends_at, held_until,"
            " made_at, state, purpose, version, shared, turn_min)"
            " VALUES (?, ?, ?, ?, ?, ?, ?, ?, 'booked', '', 1, 'course', 10)",
            [booking.hex, robot, staff, course, str(now), until, until, str(now)],
        )
        database.commit()
        yield str(booking)
        # Its letters, too: they would stand on the next test's pages.
        for table in (
            "bookings_turn",
            "bookings_letter",
            "bookings_booking",
            "access_enrolment",
            "access_course_robots",
        ):
            database.execute(f"DELETE FROM {table}")
        database.execute("DELETE FROM access_course WHERE id = ?", [course])
        database.commit()


def test_the_called_student_drives_until_the_teacher_skips(person: Arrive, lesson: str, tmp_path) -> None:
    teacher, student = person("staff"), person("operator")
    student.watch(ROBOT)
    teacher.open(f"/bookings/{lesson}/lesson/")
    teacher.press("Put everybody into the line")
    teacher.page.get_by_text("Tasks of this lesson").click()
    line = student.part("lesson-words")
    expect(line).to_contain_text("Your turn: take control within")
    student.press("Take control")
    student.until_in_control()
    expect(line).to_contain_text("Your turn.")
    for width, height in SIZES:
        student.page.set_viewport_size({"width": width, "height": height})
        expect(line).to_be_visible()
        student.page.screenshot(path=tmp_path / f"drive-{width}.png")
        teacher.page.set_viewport_size({"width": width, "height": height})
        teacher.page.screenshot(path=tmp_path / f"line-{width}.png")
        wide = teacher.page.evaluate("document.documentElement.scrollWidth")
        assert wide <= width, wide
    expect(teacher.part("live")).to_contain_text("drives")  # without a reload
    assert found_by_axe(teacher) == []
    teacher.press("Skip Operator")
    student.until(lambda: student.control["state"] != "yours", "the end of the turn")
    expect(student.part("who")).to_have_text("Nobody has control")
