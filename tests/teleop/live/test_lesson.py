"""A lesson on the pages of its people: the line, the call, the turn's end, and the teacher's hand."""

from datetime import timedelta
from functools import partial

import pytest
from django.utils import timezone

from fleet.bookings.lessons import turns
from fleet.bookings.models import Booking, Turn
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_make
from robots.access.models import Course, Enrolment
from teleop.background.database import in_database
from tests.teleop.support import Page

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture
def lesson(robot, supervisor, operator, second_operator):
    today = timezone.now().date()
    days = {"starts_on": today - timedelta(days=2), "ends_on": today + timedelta(days=30)}
    course = Course.objects.create(name="HRI 2026", slug="hri", role="operator", **days)
    course.robots.add(robot)
    course.supervisors.add(supervisor)
    for person in (operator, second_operator):
        Enrolment.objects.create(course=course, person=person)
    now = timezone.now()
    slot = Slot(now, now + timedelta(hours=1))
    return booking_make(robot=robot, person=supervisor, slot=slot, now=now, lesson_of=course, turn_min=10)


async def until(page, wanted):
    """Read `control` messages until one fits."""
    while not wanted(control := await page.hears("control")):
        pass
    return control


def skip(lesson):
    turn = Turn.objects.get(state="driving")
    actor = Booking.objects.get().person
    turns.turn_skip(booking_id=lesson.pk, turn_id=turn.pk, actor=actor, now=timezone.now())


async def test_the_line_calls_ends_and_calls_the_next(lesson, open_page):
    teacher, first, second = [await open_page(who) for who in ("supervisor", "operator", "second")]
    assert first.control["lesson"]["waiting"] == 0
    assert teacher.control["lesson"]["leads"]
    await first.say("ask")
    called = await until(first, lambda control: control["lesson"]["yours"])
    assert called["refusal"] is None
    await first.say("take")
    mine = await until(first, lambda control: control["state"] == "yours")
    assert 590 < mine["remaining_s"] <= 600
    await second.say("ask")
    waits = await until(second, lambda control: control["lesson"]["place"] == 1)
    assert waits["lesson"]["turn"] == "Olga Operator"
    await in_database(skip, lesson)  # the teacher skips her
    lost = await until(first, lambda control: control["state"] != "yours")
    assert lost["refusal"]["code"] == "not_your_turn"
    await until(second, lambda control: control["lesson"]["yours"])
    await second.say("take")
    await until(second, lambda control: control["state"] == "yours")
    back = await until(teacher, lambda control: control["holder"] == "Olaf Operator")
    assert back["may_take_back"]
    await teacher.say("take_over", reason="")
    await until(teacher, lambda control: control["state"] == "yours")
    await until(second, lambda control: control["lesson"]["place"] == 1)
    await teacher.say("release")
    await until(second, lambda control: control["lesson"]["yours"])  # has the rest of the turn
    assert (await in_database(Booking.objects.get)).person_id == lesson.person_id


async def test_a_turn_ends_by_itself_and_the_next_is_called(lesson, open_page):
    first, second = [await open_page(who) for who in ("operator", "second")]
    await first.say("take")
    await until(first, lambda control: control["state"] == "yours")
    await second.say("ask")
    await until(second, lambda control: control["lesson"]["place"] == 1)
    soon = timezone.now() + timedelta(seconds=1)
    await in_database(lambda: Turn.objects.filter(state="driving").update(ends_at=soon))
    ended = await first.hears("notice", code="slot")
    assert ended["text"] == "Your turn is over."
    await until(second, lambda control: control["lesson"]["yours"])


async def test_other_pages_hear_of_a_turn_and_name_who_is_called(
    lesson, operator, second_operator, browsers, websocket_headers, bridge
):
    calendar = await Page(websocket_headers(browsers["observer"]), "/ws/bookings/").open()
    fleet = await Page(websocket_headers(browsers["observer"]), "/ws/fleet/").open()
    for _ in range(2):  # when it opens, and when the console begins to check
        await calendar.hears("bookings_changed")
    for person in (operator, second_operator):
        await in_database(partial(turns.turn_join, booking_id=lesson.pk, person=person, now=timezone.now()))
    await calendar.hears("bookings_changed", turns=True)
    turn = None
    while turn is None or None in (turn["person"], turn["next"]):
        [card] = (await fleet.hears("fleet"))["robots"].values()
        await fleet.say("ack")
        turn = card["booked"]["turn"]
    assert (turn["person"], turn["driving"], turn["next"]) == ("Olga Operator", False, "Olaf Operator")
    assert 80 < turn["seconds"] <= 90
    for page in (calendar, fleet):
        await page.close()
