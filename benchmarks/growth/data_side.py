"""Fill a database with many people, and measure pages in it: queries, time, size. Runs in a process of its own.

2,000 people; a robot on which 600 of them have a role of their own; a robot group and a course with all of them; 20
robots, each booked for most of the next days.
"""

from __future__ import annotations

import itertools
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from functools import partial
from typing import Any
from unittest import mock

from django.db.backends.utils import CursorWrapper
from django.test import Client
from django.test.utils import setup_test_environment
from django.urls import reverse
from django.utils import timezone

from benchmarks.harness import quantile
from fleet.accounts.models import User
from fleet.bookings.models import Booking
from robots.access.models import Course, Enrolment, GroupRole, RobotGroup
from robots.access.selectors import lab_date
from robots.registry.models import Robot, RobotProfile, RobotRole, Role

PEOPLE = 2000
DIRECT = 600
ROBOTS = 20
REPEATS = 5
HOUR = timedelta(hours=1)


def main() -> None:
    """Fill the database; print a JSON line for each page."""
    staff, supervisor = fill()
    robot = Robot.objects.get(slug="robot-0")
    measured = {
        "robot in the admin, 600 roles": (
            staff,
            reverse(f"admin:{Robot._meta.app_label}_robot_change", args=[robot.pk]),
        ),
        "robot groups, 2,000 people": (staff, "/robot-groups/"),
        "people of a group, 2,000 people": (staff, "/robot-groups/growth/people/"),
        "course, 2,000 people": (staff, "/courses/growth/"),
        "next free hour, supervisor": (supervisor, "/bookings/next-free/"),
        "next free hour, student": (User.objects.get(username="person-1999"), "/bookings/next-free/"),
    }
    for name, (person, path) in measured.items():
        client = Client()
        client.force_login(person)
        print(json.dumps({"page": name, **read(partial(client.get, path))}), flush=True)
    print(
        json.dumps({"page": "saved", **saved(staff, measured["robot in the admin, 600 roles"][1])}),
        flush=True,
    )


def fill() -> tuple[User, User]:
    """Store people, roles, a group, a course and bookings; return a member of staff and a supervisor."""
    staff = User.objects.create(username="growth-staff", is_staff=True, is_superuser=True)
    supervisor = User.objects.create(username="growth-supervisor")
    people = User.objects.bulk_create(
        User(username=f"person-{n:04}", full_name=f"Person {n}") for n in range(PEOPLE)
    )
    profile = RobotProfile.objects.get(slug="tiago")
    robots = [
        Robot.objects.create(
            slug=f"robot-{n}", name=f"Robot {n}", profile=profile, master_uri="http://127.0.0.1:9"
        )
        for n in range(ROBOTS)
    ]
    RobotRole.objects.bulk_create(
        RobotRole(robot=robots[0], user=one, role=Role.OPERATOR) for one in people[:DIRECT]
    )
    group = RobotGroup.objects.create(name="Growth", slug="growth")
    group.robots.set(robots)
    GroupRole.objects.create(group=group, user=supervisor, role=Role.SUPERVISOR)
    GroupRole.objects.bulk_create(GroupRole(group=group, user=one, role=Role.OBSERVER) for one in people)
    today = lab_date()
    course = Course.objects.create(
        name="Growth", slug="growth", starts_on=today, ends_on=today + timedelta(days=90)
    )
    course.robots.set(robots)
    Enrolment.objects.bulk_create(
        Enrolment(course=course, person=one, number=f"{n:07}") for n, one in enumerate(people)
    )
    first = timezone.now().replace(minute=0, second=0, microsecond=0)
    Booking.objects.bulk_create(
        Booking(
            robot=robot,
            person=people[n * 100 + hour % 100],
            starts_at=first + hour * HOUR,
            ends_at=first + (hour + 1) * HOUR,
            held_until=first + (hour + 1) * HOUR,
            made_at=first,
        )
        for n, robot in enumerate(robots)
        for hour in range(60)
    )
    return staff, supervisor


def read(ask: Callable[[], Any]) -> dict[str, Any]:
    """Return the queries of one answer, the median time of the next ones, and their size."""
    ask()  # templates are loaded
    with counted() as queries:
        answer = ask()
    if answer.status_code not in (200, 302):
        raise RuntimeError(f"{answer.status_code} instead of the page")
    times = []
    for _ in range(REPEATS):
        began = time.process_time()
        ask()
        times.append(1000.0 * (time.process_time() - began))
    return {"queries": queries(), "ms": quantile(times, 0.5), "kB": len(answer.content) / 1000.0}


@contextmanager
def counted() -> Iterator[Callable[[], int]]:
    """Count the statements of all threads: some views run on one of their own."""
    number = itertools.count()
    execute = CursorWrapper.execute

    def noted(*arguments: Any) -> Any:
        next(number)
        return execute(*arguments)

    with mock.patch.object(CursorWrapper, "execute", noted):
        yield lambda: next(number)


def saved(staff: User, path: str) -> dict[str, Any]:
    """Save the robot's page as it is shown; return the status of the answer, and its time."""
    setup_test_environment()  # answers have their context; the other pages are measured without this delay
    client = Client()
    client.force_login(staff)
    page = client.get(path)
    values: dict[str, Any] = {}
    for form in [page.context["adminform"].form, *_inline_forms(page.context)]:
        for field in form:
            value = field.value()
            if value is not None and value is not False:
                values[field.html_name] = "on" if value is True else value
    values["room"] = "Hall 2"
    began = time.process_time()
    answer = client.post(path, values)
    return {
        "status": answer.status_code,
        "ms": 1000.0 * (time.process_time() - began),
        "room": Robot.objects.get(slug="robot-0").room,
    }


def _inline_forms(context: Any) -> list[Any]:
    sets = [inline.formset for inline in context["inline_admin_formsets"]]
    return [form for one in sets for form in [one.management_form, *one.forms]]
