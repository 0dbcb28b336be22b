"""Fill a console's database, and measure the rules of control in it. Runs in `manage.py shell`.

The database gets ten robots that the operator may drive, one of them in service, and bookings of one hour,
nine tenths of them in the past. The robot in service has no bookings in the next 48 hours.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from datetime import timedelta

from django.db import connection
from django.utils import timezone

from benchmarks.harness import quantile
from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope
from fleet.accounts.tokens.services import token_make
from fleet.bookings.models import Booking, Shared
from fleet.bookings.schedule import Schedule, schedule_of
from robots.access.models import Course, Enrolment
from robots.access.selectors import lab_date, role_on
from robots.records.faults import ROBOT, Condition, record_part
from robots.registry.models import Robot, RobotProfile, RobotRole, Role
from teleop.control.rules import Subject, permit_for

ROBOTS = 10
REPEATS = 300
HOUR = timedelta(hours=1)
DAY = timedelta(days=1)


def fill(rows: int) -> list[Robot]:
    """Store robots, roles and bookings."""
    person = User.objects.get(username="operator")
    others = User.objects.create(username="others")  # one person books one robot at a time
    profile = RobotProfile.objects.get(slug="tiago")
    robots = [
        Robot.objects.create(
            slug=f"row-{number}",
            name=f"Robot {number}",
            profile=profile,
            master_uri="http://127.0.0.1:9",
            enabled=number == 0,  # only this robot can be booked: the others are switched off
        )
        for number in range(ROBOTS)
    ]
    RobotRole.objects.bulk_create(RobotRole(robot=robot, user=person, role=Role.OPERATOR) for robot in robots)
    now = timezone.now()
    each = rows // ROBOTS
    first = now.replace(minute=0, second=0, microsecond=0) - each * 9 // 10 * HOUR
    for robot in robots:
        hours = [first + number * HOUR for number in range(each)]
        free = [start for start in hours if not (now - HOUR < start < now + 48 * HOUR and robot is robots[0])]
        Booking.objects.bulk_create(
            (
                Booking(
                    robot=robot,
                    person=others,
                    starts_at=start,
                    ends_at=start + HOUR,
                    held_until=start + HOUR,
                    used_at=start,
                    made_at=now,
                )
                for start in free
            ),
            batch_size=500,
        )
    return robots


def fill_one(slug: str, rows: int) -> None:
    """Store one robot's bookings: the operator's slot began a minute ago, others are before and after."""
    robot = Robot.objects.get(slug=slug)
    robot.bookings.all().delete()
    person, (others, _made) = (
        User.objects.get(username="operator"),
        User.objects.get_or_create(username="others"),
    )
    now = timezone.now()
    begun = now - timedelta(minutes=1)
    starts = (begun + number * HOUR for number in range(2 - rows, 2)) if rows else ()
    Booking.objects.bulk_create(
        (
            Booking(
                robot=robot,
                person=person if start == begun else others,
                starts_at=start,
                ends_at=start + HOUR,
                held_until=start + HOUR,
                used_at=start if start < begun else None,
                made_at=start,
            )
            for start in starts
        ),
        batch_size=500,
    )


def students(count: int, password: str) -> None:
    """Store accounts with the same password."""
    first = User(username="student-0")
    first.set_password(password)
    User.objects.bulk_create(
        User(username=f"student-{number}", password=first.password) for number in range(count)
    )


def lesson(count: int) -> None:
    """Store a lesson that runs now, for these students; print its id and a token of each.

    Nobody is called to a robot that is offline. This one has no bridge, so its fault is ended, which the fleet's watch
    records only once.
    """
    robot, now = Robot.objects.get(slug="row-0"), timezone.now()
    teacher, people = User.objects.get(username="staff"), User.objects.filter(username__startswith="student-")
    today = lab_date(now)
    course = Course.objects.create(name="Line", slug="line", starts_on=today, ends_on=today + 30 * DAY)
    course.robots.add(robot)
    Enrolment.objects.bulk_create(Enrolment(course=course, person=person) for person in people[:count])
    robot.bookings.filter(held_until__gt=now - HOUR, starts_at__lt=now + HOUR).delete()
    booking = Booking.objects.create(
        robot=robot,
        person=teacher,
        course=course,
        shared=Shared.COURSE,
        turn_min=5,
        starts_at=now - timedelta(minutes=1),
        ends_at=now + HOUR,
        held_until=now + HOUR,
        made_at=now,
    )
    tokens = [
        token_make(
            user=person, name="line", scopes=[Scope.READ, Scope.BOOK], expires_at=now + DAY, actor=person
        )[1]
        for person in people[:count]
    ]
    record_part(robot.pk, ROBOT, Condition())
    print(json.dumps({"booking": str(booking.pk), "tokens": tokens}))


def p95_ms(step: Callable[[], object]) -> float:
    """Return the 95th percentile of a step's duration, in ms."""
    spent = []
    for _ in range(REPEATS):
        began_s = time.perf_counter()
        step()
        spent.append(1000.0 * (time.perf_counter() - began_s))
    return quantile(spent, 0.95)


def rules(robot: Robot, person: User, read: Callable[[], Schedule]) -> Callable[[], object]:
    """Return a step that checks the rules of control."""

    def step() -> object:
        role = role_on(person, robot)
        return permit_for(Subject(person, robot, role, read(), timezone.now()))

    return step


def main(rows: int) -> None:
    """Fill, measure, and print JSON: p95 in ms of the rules of control, with bookings and without."""
    robot = fill(rows)[1]
    with connection.cursor() as cursor:
        # A database that was filled over months has statistics already, and no large clean-up to do.
        cursor.execute("VACUUM ANALYZE" if connection.vendor == "postgresql" else "ANALYZE")
    person = User.objects.get(username="operator")
    with_ms = p95_ms(rules(robot, person, lambda: schedule_of(robot, timezone.now())))
    without_ms = p95_ms(rules(robot, person, Schedule))
    print(json.dumps({"with_ms": with_ms, "without_ms": without_ms}))
