"""``manage.py seed_demo_week FILE``: a course, bookings around now and a past week of use, for script/demo.

FILE is JSON: {"students": [{"username", "password"}]}; the simulated robots must be there. A second run does nothing.
"""

from __future__ import annotations

from datetime import datetime, timedelta
from itertools import count
from pathlib import Path
from typing import Any

from django.core.management.base import BaseCommand, CommandParser
from django.db import transaction
from django.utils import timezone
from msgspec import Struct
from msgspec.json import decode

from fleet.accounts.models import User
from fleet.bookings.models import Booking, State
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_make
from robots.access.models import Course, Enrolment, Qualification, QualificationGrant
from robots.registry.models import Robot, Role
from teleop.models import ControlSession, EndReason

HOUR = timedelta(hours=1)
DAYS = 7  # of past use
BEGIN_H, STEP_H = 9, 2  # slots of a past day: every second hour from nine
WEEK_MIN = 600  # a person's quota per robot: enough on a Sunday night, when the whole past week counts


class Student(Struct, frozen=True):
    """An account of FILE."""

    username: str
    password: str


class Plan(Struct, frozen=True):
    """The content of FILE that this command reads."""

    students: list[Student]


class Command(BaseCommand):
    """A course of students with bookings, for script/demo."""

    help = "Make the course, the bookings and the past week of script/demo."

    def add_arguments(self, parser: CommandParser) -> None:
        """Add the option: file."""
        parser.add_argument("file", type=Path)

    def handle(self, *args: Any, **options: Any) -> None:
        """Seed in one transaction."""
        plan = decode(options["file"].read_bytes(), type=Plan)
        if Course.objects.exists():
            return
        now = timezone.now().replace(second=0, microsecond=0)
        with transaction.atomic():
            robots = list(Robot.objects.order_by("slug"))
            people = [seed_student(student) for student in plan.students]
            seed_course(people, robots, now)
            seed_past(people, robots, now)
            seed_bookings(people, robots, now)


def seed_student(student: Student) -> User:
    """Create a student's account."""
    name = student.username.capitalize()
    return User.objects.create_user(student.username, password=student.password, full_name=f"{name} Student")


def seed_course(people: list[User], robots: list[Robot], now: datetime) -> None:
    """Create a course that lasts 90 more days.

    The last of several robots demands a qualification that all people but the last student hold.
    """
    course = Course.objects.create(
        name="Human-Robot Interaction",
        slug="hri",
        role=Role.OPERATOR,
        starts_on=(now - timedelta(days=30)).date(),
        ends_on=(now + timedelta(days=90)).date(),
        week_min=WEEK_MIN * len(robots),
    )
    course.robots.set(robots)
    course.supervisors.set(User.objects.filter(username="supervisor"))
    Enrolment.objects.bulk_create(Enrolment(course=course, person=person) for person in people)
    induction = Qualification.objects.create(name="safety induction", slug="safety-induction")
    induction.robots.set(robots[1:][-1:])
    QualificationGrant.objects.bulk_create(
        QualificationGrant(qualification=induction, person=person)
        for person in User.objects.exclude(pk=people[-1].pk)
    )


def seed_past(people: list[User], robots: list[Robot], now: datetime) -> None:
    """Store a week of slots: most were used, some finished early, some not used."""
    midnight = now.replace(hour=0, minute=0, second=0, microsecond=0)
    course = Course.objects.get()
    past = count(1)
    for day in range(1, DAYS + 1):
        for row, robot in enumerate(robots):
            for number in range(3):
                starts = midnight - timedelta(days=day) + timedelta(hours=BEGIN_H + STEP_H * number + row)
                person = people[(day + row + number) % len(people)]
                shown = (day + number + row) % 6 != 0
                ends = starts + (HOUR if (day + number) % 4 else HOUR * 3 / 4)
                Booking.objects.create(
                    robot=robot,
                    person=person,
                    course=course,
                    starts_at=starts,
                    ends_at=starts + HOUR,
                    held_until=ends if shown else starts + HOUR / 4,
                    state=State.NO_SHOW
                    if not shown
                    else State.BOOKED
                    if ends == starts + HOUR
                    else State.FINISHED,
                    used_at=starts + timedelta(minutes=2) if shown else None,
                    made_at=starts - timedelta(days=2),
                )
                if shown:
                    ControlSession.objects.create(
                        robot=robot,
                        user=person,
                        # Below zero: a bridge without state file stops a robot that had a fence above zero.
                        fence=-next(past),
                        started_at=starts + timedelta(minutes=2),
                        ended_at=ends,
                        end_reason=EndReason.SLOT if ends == starts + HOUR else EndReason.RELEASED,
                    )


def seed_bookings(people: list[User], robots: list[Robot], now: datetime) -> None:
    """Book slots from now on that do not overlap, even with only one robot.

    Only one robot is in a slot now.
    """
    hour = now.replace(minute=0, second=0, microsecond=0) + HOUR
    first, second, last = robots[0], robots[1 % len(robots)], robots[-1]
    anna, ben, cleo, dana = people
    slots = [
        (second, anna, now, hour + HOUR),
        (last, ben, hour + HOUR, hour + 3 * HOUR),
        (first, cleo, hour + 3 * HOUR, hour + 4 * HOUR),
        (first, dana, hour + 4 * HOUR, hour + 5 * HOUR),
        (first, ben, hour + 24 * HOUR, hour + 26 * HOUR),
        (second, cleo, hour + 26 * HOUR, hour + 27 * HOUR),
        (first, anna, hour + 49 * HOUR, hour + 50 * HOUR),
    ]
    for robot, person, starts, ends in slots:
        booking_make(robot=robot, person=person, slot=Slot(starts, ends), now=now, purpose="Exercise")
