"""Recordings that a page asks for: who may, what the bridge is told, what is on record."""

from datetime import timedelta
from uuid import uuid4

import pytest
from django.utils import timezone

from fleet.audit.models import Record
from fleet.audit.services import record
from fleet.bookings.models import Booking
from fleet.bookings.schedule import Schedule
from robots.shared.wire import LinkKeep, LinkRecord, LinkRecordEnd, Refusal
from teleop.background.database import in_database
from teleop.recordings.orders.requests import seconds_left
from tests.teleop.support import eventually

pytestmark = pytest.mark.django_db(transaction=True)


def outcomes(kind: str) -> list[str]:
    return list(Record.objects.filter(kind=kind).order_by("seq").values_list("outcome", flat=True))


async def test_the_holder_records_until_the_slot_ends(holder, bridge, robot, operator):
    now = timezone.now()
    booking = await in_database(
        lambda: Booking.objects.create(
            robot=robot,
            person=operator,
            starts_at=now - timedelta(minutes=5),
            ends_at=now + timedelta(minutes=10),
            held_until=now + timedelta(minutes=10),
            made_at=now,
        )
    )
    await holder.say("record", topics=["/scan"], reason="a report", seq=7)
    await holder.hears("accepted", of="record", seq=7)
    [order] = bridge.all(LinkRecord)
    assert order.topics == ["/scan"] and order.person == str(operator.pk) and order.reason == "a report"
    assert order.booking == str(booking.pk) and order.session and 590 < order.seconds <= 600
    await holder.say("record_end", recording=str(order.recording), seq=8)
    await holder.hears("accepted", of="record_end", seq=8)
    assert bridge.all(LinkRecordEnd)[0].recording == order.recording
    await holder.say("keep_this", seq=9)
    await holder.hears("accepted", of="keep_this", seq=9)
    assert bridge.all(LinkKeep)[0].by == "Olga Operator"
    for kind in ("recording.begin", "recording.end", "recording.mark"):
        await eventually(lambda kind=kind: outcomes(kind) == ["", "accepted"])


async def test_a_refusal_of_the_bridge_is_answered_and_on_record(holder, bridge):
    bridge.refuses_tasks = Refusal("recording_goes_on", "Ben records this robot already.", "robot")
    await holder.say("record", seq=1)
    refused = await holder.hears("refused", of="record", seq=1)
    assert refused["refusal"]["code"] == "recording_goes_on"
    await eventually(lambda: outcomes("recording.begin") == ["", "recording_goes_on"])


@pytest.mark.parametrize(
    ("who", "may"), [("observer", False), ("second", False), ("supervisor", True), ("staff", True)]
)
async def test_who_may_without_control(who, may, holder, open_page, bridge):
    page = await open_page(who)
    for seq, (kind, fields) in enumerate(
        {"record": {}, "record_end": {"recording": str(uuid4())}, "keep_this": {}}.items(), 1
    ):
        await page.say(kind, seq=seq, **fields)
        heard = await page.hears("accepted" if may else "refused", of=kind, seq=seq)
        assert may or heard["refusal"]["code"] == "no_lease"
    assert bool(bridge.all(LinkRecord)) is may


async def test_who_began_it_may_end_it_without_control(holder, bridge):
    await holder.say("record", seq=1)
    await holder.hears("accepted", of="record", seq=1)
    await holder.say("release")
    await holder.hears("control", state="free")
    await holder.say("record_end", recording=str(bridge.all(LinkRecord)[0].recording), seq=2)
    await holder.hears("accepted", of="record_end", seq=2)


async def test_who_began_it_may_end_it_although_its_recorder_broke(holder, bridge):
    await holder.say("record", seq=1)
    await holder.hears("accepted", of="record", seq=1)
    await eventually(lambda: outcomes("recording.begin") == ["", "accepted"])
    await holder.say("release")
    await holder.hears("control", state="free")
    await holder.say("record_end", recording=str(uuid4()), seq=2)  # it goes on with another number
    await holder.hears("accepted", of="record_end", seq=2)


@pytest.mark.parametrize("rule", [True, False])
async def test_the_recording_of_a_booking_is_ended_by_whoever_asked_for_it(
    rule, holder, bridge, robot, operator, settings
):
    settings.FLEET_RECORD_EVERY_BOOKING = rule
    now = timezone.now()

    def booked():
        times = {
            "starts_at": now - timedelta(minutes=5),
            "ends_at": now + timedelta(minutes=9),
            "made_at": now,
        }
        booking = Booking.objects.create(
            robot=robot, person=operator, record=True, held_until=times["ends_at"], **times
        )
        facts = {"robot_id": robot.pk, "robot_name": robot.name}
        begun = record("recording.begin", parameters={"booking": str(booking.pk)}, **facts)
        record("recording.begin", of=begun, outcome="accepted", **facts)

    await in_database(booked)
    await holder.say("record_end", recording=str(uuid4()), seq=1)
    heard = await holder.hears("refused" if rule else "accepted", of="record_end", seq=1)
    assert not rule or heard["refusal"]["code"] == "recorded_by_rule"


def test_in_free_time_it_lasts_two_hours_at_most():
    assert seconds_left(Schedule(), timezone.now()) == 7200.0
