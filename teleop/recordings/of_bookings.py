"""Recordings of bookings: each begins when somebody takes control in a slot that is to be recorded, and ends with it.

Housekeeping calls this every few seconds, so that a recording begins whatever page or program took control. The bridge
ends it by its own clock. A slot that became shorter ends it earlier; one that became longer gets another recording.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from datetime import datetime, timedelta
from uuid import UUID, uuid5

from django.conf import settings
from django.db.models import F, Q, QuerySet

from fleet.audit.services import record
from fleet.bookings.models import Booking, Shared
from fleet.bookings.models import State as Stored
from robots.link.state_reader import order_once, state_once
from robots.registry.selectors import link_address
from robots.shared.wire import LinkRecord, LinkRecordEnd, NotDone, RecordingState, Refusal
from robots.shared.wire.recordings import LONGEST_RECORDING_S
from teleop.recordings.quota import check_quota

log = logging.getLogger(__name__)

ANSWER_S = 10.0  # a recorder takes seconds to start
AGAIN_S = 120.0  # pause after a bridge was away or refused
LEAST = timedelta(seconds=5)  # a rest of a slot that is not worth a file

_GOES_ON = Refusal("recording_goes_on", "Somebody else records this robot already.", "robot")


class BookingRecorder:
    """Begins and ends the recordings of bookings, for one housekeeping process."""

    def __init__(self) -> None:
        self._not_before_s: dict[UUID, float] = {}  # by booking

    def step(self, now: datetime) -> None:
        """Begin what is due, and end what is over."""
        for booking in _shortened(now):
            self._attempt(booking, now, _end)
        for booking in _due(now):
            self._attempt(booking, now, _begin)

    def _attempt(self, booking: Booking, now: datetime, work: Callable[[Booking, datetime], None]) -> None:
        now_s = time.monotonic()
        if self._not_before_s.get(booking.pk, 0.0) > now_s:
            return
        try:
            work(booking, now)
            self._not_before_s.pop(booking.pk, None)
        except NotDone as refused:
            log.warning("booking %s is not recorded yet: %s", booking.pk, refused)
            self._not_before_s[booking.pk] = now_s + AGAIN_S


def _due(now: datetime) -> QuerySet[Booking]:
    """Return the slots in use that are to be recorded, and are not, or no longer."""
    wished = Q(record=True) | Q(shared=Shared.COURSE, course__record_lessons=True)
    held = Booking.objects.filter(state=Stored.BOOKED, starts_at__lte=now, held_until__gt=now + LEAST)
    if not settings.FLEET_RECORD_EVERY_BOOKING:
        held = held.filter(wished)
    used = held.exclude(used_at=None).filter(Q(recorded_until=None) | Q(recorded_until__lte=now))
    return used.select_related("robot", "person", "course")


def _shortened(now: datetime) -> QuerySet[Booking]:
    """Return the slots that end earlier than their recording."""
    found = Booking.objects.filter(recorded_until__gt=now, held_until__lt=F("recorded_until"))
    return found.select_related("robot")


def _begin(booking: Booking, now: datetime) -> None:
    """Begin a recording of the rest of the slot. Raises `NotDone`."""
    # The same at each attempt: one that lost its answer is found again
    recording = uuid5(booking.pk, str(booking.recorded_until))
    goes_on = _going_on(booking)
    if goes_on is None:
        order = LinkRecord(
            recording,
            min((booking.held_until - now).total_seconds(), LONGEST_RECORDING_S),
            "all",
            booking.person.display_name,
            str(booking.person_id),
            kind="booking",
            booking=str(booking.pk),
            course=booking.course.slug if booking.course else "",
        )
        _carry_out(booking, order)
    elif goes_on.recording != recording:
        raise NotDone(_GOES_ON)
    Booking.objects.filter(pk=booking.pk).update(recorded_until=booking.held_until)


def _end(booking: Booking, now: datetime) -> None:
    """End the recording of a slot that ends earlier. Raises `NotDone`."""
    if booking.held_until > now:
        return
    goes_on = _going_on(booking)
    if goes_on is not None and goes_on.kind == "booking":
        _carry_out(booking, LinkRecordEnd(goes_on.recording))
    Booking.objects.filter(pk=booking.pk).update(recorded_until=now)


def _going_on(booking: Booking) -> RecordingState | None:
    """Return the recording of the robot that goes on. Raises `NotDone`."""
    state = state_once(booking.robot_id, link_address(booking.robot)).recording
    return state if state is not None and state.refusal is None else None


def _carry_out(booking: Booking, order: LinkRecord | LinkRecordEnd) -> None:
    """Record a request, send it, and record its outcome. Raises `NotDone`."""
    parameters = {"recording": str(order.recording), "booking": str(booking.pk)}
    robot = booking.robot
    if isinstance(order, LinkRecord):
        begun = record("recording.begin", robot_id=robot.pk, robot_name=robot.name, parameters=parameters)
    else:
        begun = record("recording.end", robot_id=robot.pk, robot_name=robot.name, parameters=parameters)
    try:
        if isinstance(order, LinkRecord):
            check_quota(robot.pk, None)
        order_once(robot.pk, link_address(robot), order, ANSWER_S)
    except NotDone as refused:
        outcome, words = refused.refusal.code, {"words": refused.refusal.sentence}
        record(begun.kind, of=begun, outcome=outcome, private=words)
        raise
    record(begun.kind, of=begun, outcome="accepted")
