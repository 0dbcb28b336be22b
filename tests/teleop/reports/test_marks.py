"""Marks of a course: everybody who is enrolled, what counts for the course, and who may read it."""

from __future__ import annotations

import csv
from datetime import UTC, date, datetime, timedelta
from io import StringIO
from typing import Any

import pytest
from django.test import Client
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.audit.services import record
from fleet.bookings.models import Booking, State
from robots.access.models import Course, Enrolment
from robots.registry.models import Robot
from teleop.models import ControlSession
from teleop.reports.marks import Mark, marks_of

NOON = datetime(2026, 3, 30, 12, tzinfo=UTC)
NOW = NOON + timedelta(days=1)


def at(minutes: float) -> datetime:
    return NOON + timedelta(minutes=minutes)


@pytest.fixture
def course(robot: Robot, operator: User, observer: User) -> Course:
    made = Course.objects.create(
        name="HRI", slug="hri", starts_on=date(2026, 3, 1), ends_on=date(2026, 6, 30), role="operator"
    )
    made.robots.add(robot)
    Enrolment.objects.create(course=made, person=operator, number="=007")
    Enrolment.objects.create(course=made, person=observer)
    return made


def booked(robot: Robot, person: User, course: Course | None, begins: int, ends: int, **more: Any) -> None:
    Booking.objects.create(
        robot=robot,
        person=person,
        course=course,
        starts_at=at(begins),
        ends_at=at(ends),
        held_until=at(ends),
        made_at=NOON,
        **more,
    )


def drove(robot: Robot, person: User, begins: float, ends: float, metres: float, monkeypatch: Any) -> None:
    fence = ControlSession.objects.count() + 1
    session = ControlSession.objects.create(
        robot=robot, user=person, fence=fence, started_at=at(begins), ended_at=at(ends)
    )
    with monkeypatch.context() as patch:
        patch.setattr(timezone, "now", lambda: at(ends) - timedelta(seconds=1))
        record(
            "drive.end",
            actor=person,
            parameters={"duration_s": 60.0, "distance_m": metres},
            robot_id=robot.id,
            robot_name=robot.name,
            session_id=session.pk,
        )


@pytest.fixture
def term(
    course: Course, robot: Robot, operator: User, stranger: User, staff: User, monkeypatch: pytest.MonkeyPatch
) -> Course:
    """A lesson, a booking that was used and one that was not, another course's booking, and free time."""
    lesson = {"shared": "course", "used_at": at(0)}
    booked(robot, staff, course, 0, 60, **lesson)
    booked(robot, operator, course, 100, 160, used_at=at(100))
    booked(robot, operator, course, 200, 260, state=State.NO_SHOW)
    booked(robot, stranger, None, 300, 360, used_at=at(300))
    drove(robot, operator, 10, 20, 30.0, monkeypatch)  # a turn in the lesson
    drove(robot, operator, 90, 130, 7.0, monkeypatch)  # ten minutes of free time, then the booking
    drove(robot, operator, 310, 320, 500.0, monkeypatch)  # somebody hands over in their own booking
    drove(robot, stranger, 400, 410, 1.0, monkeypatch)  # not enrolled
    return course


def test_each_figure_counts_what_belongs_to_the_course(term: Course, staff: User) -> None:
    drivers = {one.username: one for one in marks_of(term, staff, NOW)}
    assert drivers["operator"] == Mark(
        username="operator",
        name=drivers["operator"].name,
        number="=007",
        email=drivers["operator"].email,
        sessions=2,
        minutes=50.0,
        metres=37.0,
        lessons=1,
        lesson_minutes=10.0,
        free_minutes=10.0,
        bookings=2,
        not_used=1,
    )
    idle = drivers["observer"]
    assert (idle.sessions, idle.minutes, idle.free_minutes, idle.not_used) == (0, 0.0, 0.0, 0)


def test_the_file_opens_in_spreadsheets_in_the_readers_language(term: Course, staff: User) -> None:
    client = Client()
    client.force_login(staff)
    for language, mark, title in (("en", ",", "student number"), ("de", ";", "Matrikelnummer")):
        answer = client.get("/courses/hri/marks.csv", headers={"Accept-Language": language})
        assert answer.content.startswith(b"\xef\xbb\xbf")
        head, *rows = csv.reader(StringIO(answer.content.decode("utf-8-sig")), delimiter=mark)
        assert head[2] == title and {len(row) for row in rows} == {12} and len(rows) == 2
        assert ["'=007", "2", "50", "37"] in [[row[2], *row[4:7]] for row in rows]
    assert Record.objects.filter(kind="course.marks", actor_id=str(staff.pk)).count() == 2


def test_supervisors_export_what_they_may_see(term: Course, supervisor: User, operator: User) -> None:
    client = Client()
    client.force_login(operator)
    assert client.get("/courses/hri/marks.csv").status_code == 404
    term.supervisors.add(supervisor)
    assert [one.free_minutes for one in marks_of(term, supervisor, NOW) if one.number] == [10.0]
    supervisor.robot_roles.all().delete()  # the course's last day is over: its robots are none of theirs
    [mark] = [one for one in marks_of(term, supervisor, NOW) if one.number]
    assert (mark.minutes, mark.free_minutes, mark.metres) == (40.0, None, 37.0)
