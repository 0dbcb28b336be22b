"""Control, bookings, courses and accounts change at the same moments: no two changes wait for each other for ever.

With FLEET_DATABASE_URL it runs on PostgreSQL, which finds such a deadlock and refuses one of the two.
"""

import random
import threading
import time
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from django.db import connection
from django.utils import timezone

from fleet.accounts.models import User
from fleet.bookings.changes.waiting_list import keep_waiting_lists, waiting_join
from fleet.bookings.lessons.turns import line_hold, turn_call, turn_join, turn_leave, turn_skip
from fleet.bookings.losses.lost_rights import bookings_free_lost
from fleet.bookings.models import Booking
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_cancel, booking_hand, booking_make
from robots.access.enrolment import enrol, unenrol
from robots.access.models import Course
from robots.registry.models import Robot, RobotProfile, Role
from robots.shared.wire import NotDone
from teleop.control import services
from teleop.control.changes import NotStored
from teleop.control.lease_checks import Tab
from teleop.control.selectors import lease_of, line_of
from teleop.control.waiting.line import line_join, offer_next
from teleop.control.waiting.turns import turns_settle
from teleop.models import EndReason

pytestmark = pytest.mark.django_db(transaction=True)

LASTS_S = 8.0
THREADS = 8


class Lab:
    """Two robots, six students of a course, and the changes that can happen next."""

    def __init__(self, profile: RobotProfile) -> None:
        self.robots = [
            Robot.objects.create(slug=name, name=name, profile=profile, master_uri="http://127.0.0.1:9")
            for name in ("one", "two")
        ]
        self.staff = User.objects.create_user("staff", is_staff=True)
        self.people = [User.objects.create_user(f"student-{number}") for number in range(6)]
        today = timezone.now().date()
        days = {"starts_on": today - timedelta(days=1), "ends_on": today + timedelta(days=30)}
        self.course = Course.objects.create(name="HRI", slug="hri", role=Role.OPERATOR, **days)
        self.course.robots.set(self.robots)
        enrol(course=self.course, people=self.people, actor=self.staff)
        now = timezone.now()
        slot = Slot(now, now + timedelta(hours=1))
        sharing: dict[str, Any] = {"lesson_of": self.course, "turn_min": 1}
        self.lesson = booking_make(robot=self.robots[1], person=self.staff, slot=slot, now=now, **sharing)

    def steps(self, chance: random.Random) -> list[Callable[[], object]]:
        """Return the changes that can happen next, of a random robot and a random person."""
        robot, person, now = chance.choice(self.robots), chance.choice(self.people), timezone.now()
        starts = now + timedelta(minutes=chance.choice([0, 15, 30]))
        slot = Slot(starts, starts + timedelta(minutes=15))
        take: dict[str, Any] = {"robot_id": robot.id, "highest_fence": 0, "now": now}
        me: dict[str, Any] = {"user_id": person.id, "tab": _tab(person)}
        found: list[Callable[[], object]] = [
            lambda: booking_make(robot=robot, person=person, slot=slot, now=now),
            lambda: waiting_join(robot=robot, person=person, slot=slot, now=now),
            lambda: services.lease_take(**take, **me),
            lambda: services.lease_take_over(
                **take, user_id=self.staff.id, tab=_tab(self.staff), reason="a test"
            ),
            lambda: line_join(robot_id=robot.id, now=now, **me),
            lambda: offer_next(robot_id=robot.id, now=now),
            lambda: services.lease_expire(robot_id=robot.id, now=now + timedelta(hours=5)),
            lambda: keep_waiting_lists(now),
            lambda: bookings_free_lost(None, now),
            lambda: unenrol(course=self.course, people=[person], actor=self.staff),
            lambda: enrol(course=self.course, people=[person], actor=self.staff),
            lambda: _rename(person),
            lambda: turns_settle(robot_id=robot.id, now=now),
        ]
        if (lesson := Booking.objects.filter(pk=self.lesson.pk, held_until__gt=now).first()) is not None:
            of: dict[str, Any] = {"booking_id": lesson.pk, "now": now}
            led: dict[str, Any] = {**of, "actor": self.staff}
            steps: list[Callable[[], object]] = [
                lambda: turn_join(person=person, **of),
                lambda: turn_leave(person=person, **of),
                lambda: turn_call(username=person.username, **led),
                lambda: line_hold(hold=chance.random() < 0.5, **led),
                *(lambda one=one: turn_skip(turn_id=one.pk, **led) for one in lesson.turns.all()[:1]),
            ]
            found.append(chance.choice(steps))
        if (booking := Booking.objects.filter(robot=robot, held_until__gt=now).first()) is not None:
            seen: dict[str, Any] = {
                "booking_id": booking.pk,
                "version": booking.version,
                "actor": self.staff,
                "now": now,
            }
            found += [lambda: booking_cancel(**seen), lambda: booking_hand(to=person, **seen)]
        if (lease := lease_of(robot.id)) is not None:
            held: dict[str, Any] = {"robot_id": robot.id, "user_id": lease.user, "now": now}
            line = line_of(robot.id, now)
            found += [
                lambda: services.lease_renew(tab=lease.tab, **held),
                lambda: services.lease_end(session=lease.session, reason=EndReason.RELEASED, **held),
                *(
                    lambda one=one: services.lease_hand_over(
                        tab=lease.tab, request_id=one.id, highest_fence=0, **held
                    )
                    for one in line[:1]
                ),
            ]
        return found


def _tab(person: User) -> Tab:
    return Tab(f"{person.username}-tab", f"{person.username}-sign-in", f"{person.username}-connection")


def _rename(person: User) -> None:
    account = User.objects.get(pk=person.pk)
    account.full_name = str(time.monotonic())
    account.save()


def test_no_two_changes_wait_for_each_other(tiago: RobotProfile) -> None:
    lab = Lab(tiago)
    errors: list[Exception] = []
    done: list[int] = []
    until = time.monotonic() + LASTS_S

    def run(seed: int) -> None:
        chance = random.Random(seed)  # noqa: S311
        while time.monotonic() < until:
            try:
                chance.choice(lab.steps(chance))()
                done.append(seed)
            except NotDone as error:  # refused by a rule
                if isinstance(error, NotStored):
                    errors.append(error)
            except Exception as error:  # noqa: BLE001  # the test shows them all
                errors.append(error)
        connection.close()

    threads = [threading.Thread(target=run, args=[number]) for number in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    assert len(done) > THREADS
