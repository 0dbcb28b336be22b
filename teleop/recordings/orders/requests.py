"""Requests to record a robot: who may, what the bridge is told, what is on record. Pages and programs ask here."""

from __future__ import annotations

import logging
from datetime import datetime, timedelta
from typing import NamedTuple
from uuid import UUID, uuid4

from django.db import DatabaseError
from django.utils import timezone
from msgspec import Struct

from fleet.accounts.models import User
from fleet.audit import services as audit
from fleet.audit.errors import AuditUnavailable
from fleet.audit.models import Record
from fleet.bookings.models import Booking
from fleet.bookings.schedule import Schedule, schedule_of
from fleet.bookings.selectors import is_recorded_by_rule
from robots.registry.models import Robot
from robots.shared.wire import LinkKeep, LinkRecord, LinkRecordEnd, RecordEnd, RecordingRequest, Refusal
from robots.shared.wire import Record as Begin
from teleop.control.changes import ControlRefused, recorded_change
from teleop.control.lease_checks import LeaseState, check_in_control
from teleop.control.selectors import lease_of
from teleop.recordings.orders.housekeeping import last_accepted
from teleop.recordings.orders.quota import check_quota

log = logging.getLogger(__name__)

LONGEST = timedelta(hours=2)  # of a recording in time that nobody booked
LEAST_S = 1.0

_NOT_YOURS = Refusal(
    "no_lease", "Only the person in control, supervisors and staff begin and end recordings.", "lease"
)
_OF_BOOKING = Refusal(
    "recorded_by_rule",
    "This booking is recorded by a rule of the lab or the course: supervisors and staff end that before the slot ends.",
    "account",
)


class NamedRobot(NamedTuple):
    """The robot that is recorded."""

    id: UUID
    name: str


class Asked(Struct, frozen=True):
    """A request that is on record, and what the bridge is told."""

    begun: Record
    order: LinkRecord | LinkRecordEnd | LinkKeep


def ask_on_record(request: RecordingRequest, robot: NamedRobot, user: User, supervises: bool) -> Asked:
    """Check the request and write it into the log. Raises `NotDone`."""
    now = timezone.now()
    held = lease_of(robot.id)
    controls = check_in_control(held, user=user.pk, now=now) is None
    begun = last_accepted("recording.begin", robot.id) if isinstance(request, RecordEnd) else None
    if not (controls or supervises or (isinstance(request, RecordEnd) and _began(request, begun, user))):
        raise ControlRefused(_NOT_YOURS)
    booking = begun.parameters.get("booking", "") if begun is not None and begun.actor_id is None else ""
    if booking and not supervises and not _wished(booking, user):
        raise ControlRefused(_OF_BOOKING)
    if isinstance(request, Begin):
        check_quota(robot.id, user)
    order = _order(request, robot.id, user, held, now)
    kind, facts = _facts(order)
    facts |= {"booking": booking} if booking else {}
    reason = "" if isinstance(request, RecordEnd) else request.reason
    with recorded_change():
        begun = audit.record(
            kind,
            actor=user,
            robot_id=robot.id,
            robot_name=robot.name,
            session_id=held.session if held else None,
            fence=held.fence if held else None,
            parameters=facts,
            private={"reason": reason} if reason else {},
        )
    return Asked(begun, order)


def _order(
    request: RecordingRequest, robot_id: UUID, user: User, held: LeaseState | None, now: datetime
) -> LinkRecord | LinkRecordEnd | LinkKeep:
    if isinstance(request, RecordEnd):
        return LinkRecordEnd(request.recording)
    name, person = user.display_name, str(user.pk)
    if not isinstance(request, Begin):
        return LinkKeep(name, person, request.reason)
    schedule = schedule_of(Robot.objects.get(pk=robot_id), now)
    booking = (
        Booking.objects.filter(pk=schedule.current.id).select_related("course").first()
        if schedule.current
        else None
    )
    return LinkRecord(
        uuid4(),
        seconds_left(schedule, now),
        request.topics,
        name,
        person,
        reason=request.reason,
        session=str(held.session) if held else "",
        booking=str(booking.pk) if booking else "",
        course=booking.course.slug if booking and booking.course else "",
    )


def seconds_left(schedule: Schedule, now: datetime) -> float:
    """Return how long a recording may last that begins now: until the slot ends, or the next one begins."""
    if schedule.current is not None:
        ends_at = schedule.current.slot.ends_at
    else:
        begins = [one.slot.starts_at for one in schedule.next[:1]]
        ends_at = min([*begins, now + LONGEST])
    return max((ends_at - now).total_seconds(), LEAST_S)


def _began(request: RecordEnd, begun: Record | None, user: User) -> bool:
    """Return whether this person asked for the recording. It has another number since its recorder broke."""
    if begun is not None and begun.actor_id == str(user.pk):
        return True
    # Its outcome is written after the answer
    return Record.objects.filter(
        kind="recording.begin", actor_id=user.pk, parameters__recording=str(request.recording)
    ).exists()


def _wished(booking_id: str, user: User) -> bool:
    """Return whether the booking is recorded because this person wished it, by no rule of the lab or the course."""
    booking = Booking.objects.filter(pk=booking_id, person=user, record=True).select_related("course").first()
    return booking is not None and not is_recorded_by_rule(booking)


def _facts(order: LinkRecord | LinkRecordEnd | LinkKeep) -> tuple[str, dict[str, object]]:
    if isinstance(order, LinkRecord):
        facts: dict[str, object] = {"recording": str(order.recording), "topics": order.topics}
        return "recording.begin", facts | ({"booking": order.booking} if order.booking else {})
    if isinstance(order, LinkRecordEnd):
        return "recording.end", {"recording": str(order.recording)}
    return "recording.mark", {}


def record_outcome(begun: Record, user: User, refusal: Refusal | None) -> None:
    """Write into the log whether the bridge took the request."""
    outcome, words = (refusal.code, {"words": refusal.sentence}) if refusal else ("accepted", {})
    try:
        audit.record(begun.kind, actor=user, of=begun, outcome=outcome, private=words)
    except (AuditUnavailable, DatabaseError) as error:
        log.error("The outcome %s of record %s was not recorded: %s", outcome, begun.pk, error)
