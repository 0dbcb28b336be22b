"""Faults while the owner of a slot drives: the right ends, the robot changes its group, the clock jumps."""

import time
from datetime import timedelta

import pytest
from django.urls import reverse
from django.utils import timezone

from fleet.bookings.models import Booking, State
from robots.access.models import Course, Enrolment, RobotGroup
from robots.access.selectors import lab_date
from robots.shared import wire
from teleop.background.database import in_database
from teleop.live.grant_renewal import GRANT_S
from tests.bookings.losses.support import confirm
from tests.teleop.support import eventually

pytestmark = pytest.mark.django_db(transaction=True)

LONGEST_S = 3.0  # the console checks twice a second; a busy computer needs longer


@pytest.fixture
def slot(robot):
    """`slot(person)`: a slot of an hour that has just begun."""

    def book(person, course=None):
        starts = timezone.now() - timedelta(minutes=1)
        ends = starts + timedelta(hours=1)
        return Booking.objects.create(
            robot=robot,
            person=person,
            course=course,
            starts_at=starts,
            ends_at=ends,
            held_until=ends,
            made_at=starts,
        )

    return book


@pytest.fixture
def student_slot(robot, stranger, slot):
    """A slot of a student who may drive by a course that has the robot by its group."""
    today = lab_date()
    days = {"starts_on": today - timedelta(days=9), "ends_on": today + timedelta(days=9)}
    course = Course.objects.create(name="HRI", slug="hri", **days)
    group = RobotGroup.objects.create(name="The TIAGos", slug="the-tiagos")
    group.robots.add(robot)
    course.groups.add(group)
    Enrolment.objects.create(course=course, person=stranger)
    return slot(stranger, course)


def archive(staff, _other_robot):
    confirm(staff, staff.post(reverse("course-archive", args=["hri"]), {"archived": "1"}))


def move_the_robot(staff, other_robot):
    entry = {"entry": "the-tiagos", "the-tiagos-name": "The TIAGos", "the-tiagos-robots": [other_robot.pk]}
    confirm(staff, staff.post(reverse("robot-groups"), entry))


@pytest.mark.parametrize("change", [archive, move_the_robot])
async def test_a_right_that_ends_mid_slot_ends_control(
    change, open_page, bridge, browsers, student_slot, second_operator, other_robot
):
    page = await open_page("stranger")
    await page.take()
    waiting = await open_page("second")
    assert waiting.control["refusal"]["code"] == "booked"
    await in_database(change, browsers["staff"], other_robot)
    begun_s = time.monotonic()
    await bridge.hears(wire.Revoke)
    assert time.monotonic() - begun_s < LONGEST_S
    await waiting.hears("control", state="free", refusal=None)
    await waiting.take()
    booking = await in_database(Booking.objects.get)
    assert booking.state == State.FINISHED


@pytest.fixture
def clock(monkeypatch):
    """`clock(hours)`: set the computer's clock this much ahead."""
    right = timezone.now

    def jump(hours):
        monkeypatch.setattr(timezone, "now", lambda: right() + timedelta(hours=hours))

    return jump


async def test_a_clock_beyond_the_slot_ends_control_until_it_is_right(
    clock, open_page, bridge, operator, slot
):
    booking = await in_database(slot, operator)
    page = await open_page("operator")
    await page.take()
    begun_s = time.monotonic()
    clock(2)
    await bridge.hears(wire.Revoke)
    assert time.monotonic() - begun_s < LONGEST_S
    await page.hears("control", state="free")
    clock(0)
    await page.take()  # the slot still belongs to the operator
    assert await eventually(Booking.objects.filter(pk=booking.pk, state=State.BOOKED).first)


async def test_a_clock_that_jumps_back_gives_at_most_one_grant(
    clock, open_page, bridge, operator, second_operator, slot
):
    await in_database(slot, operator)
    page, other = await open_page("operator"), await open_page("second")
    await page.take()
    clock(-2)
    granted = len(bridge.all(wire.Grant))
    await bridge.hears(wire.Grant, count=granted + 2)
    assert max(grant.seconds for grant in bridge.all(wire.Grant)) <= GRANT_S
    await other.say("take")
    await other.refused("held")
    clock(0)
    await page.say("release")
    await page.hears("control", state="free")
    await other.say("take")
    await other.refused("booked")
