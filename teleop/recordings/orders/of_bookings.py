"""Recordings of bookings: each begins when somebody takes control in a slot that is to be recorded, and ends with it.

Housekeeping calls this every few seconds, so that a recording begins whatever page or program took control. The bridge
ends it by its own clock. A slot that became shorter ends it earlier; one that became longer gets another recording, and
so does one whose recording broke off.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from datetime import datetime, timedelta
from uuid import UUID, uuid5

from django.conf import settings
from django.db.models import F, Q, QuerySet

from fleet.bookings.models import Booking, Shared
from fleet.bookings.models import State as Stored
from robots.shared.wire import LinkRecord, LinkRecordEnd, NotDone, Refusal
from robots.shared.wire.recordings import LONGEST_RECORDING_S
from teleop.recordings.orders.housekeeping import carry_out, going_on, last_accepted
from teleop.recordings.orders.quota import check_quota

log = logging.getLogger(__name__)

AGAIN_S = 120.0  # pause after a bridge was away or refused
LOOK_S = 60.0  # between two looks whether a recording still goes on
LEAST = timedelta(seconds=5)  # a rest of a slot that is not worth a file

_GOES_ON = Refusal("recording_goes_on", "Somebody else records this robot already.", "robot")


class BookingRecorder:
    """Begins and ends the recordings of bookings, for one housekeeping process."""

    def __init__(self) -> None:
        self._not_before_s: dict[UUID, float] = {}  # by booking
        self._look_at_s: dict[UUID, float] = {}  # by booking

    def step(self, now: datetime) -> None:
        """Begin what is due, and end what is over."""
        for booking in _shortened(now):
            self._attempt(booking, now, _end)
        for booking in _begun(now):
            if self._look_at_s.get(booking.pk, 0.0) <= time.monotonic():
                self._look_at_s[booking.pk] = time.monotonic() + LOOK_S
                self._attempt(booking, now, _look)
        for booking in _due(now):
            self._look_at_s[booking.pk] = time.monotonic() + LOOK_S
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


def _wanted(now: datetime) -> QuerySet[Booking]:
    """Return the slots in use that are to be recorded."""
    wished = Q(record=True) | Q(shared=Shared.COURSE, course__record_lessons=True)
    held = Booking.objects.filter(state=Stored.BOOKED, starts_at__lte=now, held_until__gt=now + LEAST)
    if not settings.FLEET_RECORD_EVERY_BOOKING:
        held = held.filter(wished)
    return held.exclude(used_at=None).select_related("robot", "person", "course")


def _due(now: datetime) -> QuerySet[Booking]:
    """Return the slots that are to be recorded, and are not, or no longer."""
    return _wanted(now).filter(Q(recorded_until=None) | Q(recorded_until__lte=now))


def _begun(now: datetime) -> QuerySet[Booking]:
    """Return the slots whose recording was begun, and should go on."""
    return _wanted(now).filter(recorded_until__gt=now)


def _shortened(now: datetime) -> QuerySet[Booking]:
    """Return the slots that end earlier than their recording."""
    found = Booking.objects.filter(recorded_until__gt=now, held_until__lt=F("recorded_until"))
    return found.select_related("robot")


def _begin(booking: Booking, now: datetime) -> None:
    """Begin a recording of the rest of the slot; it replaces one by hand, which has fewer topics. Raises `NotDone`."""
    robot = booking.robot
    # The same at each attempt: one that lost its answer is found again
    recording = uuid5(booking.pk, str(booking.recorded_until))
    goes_on = going_on(robot)
    if goes_on is not None and goes_on.kind == "by_hand":
        check_quota(robot.pk, None)  # else the one by hand would end for nothing
        carry_out(robot, LinkRecordEnd(goes_on.recording), because="booking", booking=str(booking.pk))
        goes_on = None
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
        carry_out(robot, order, booking=str(booking.pk))
    elif goes_on.recording != recording and not _is_of(booking):
        raise NotDone(_GOES_ON)
    Booking.objects.filter(pk=booking.pk).update(recorded_until=booking.held_until)


def _look(booking: Booking, now: datetime) -> None:
    """Have it begun again if it goes on no longer, unless a person ended it. Raises `NotDone`."""
    goes_on = going_on(booking.robot)
    if goes_on is not None and goes_on.kind == "booking":
        return
    begun, ended = (
        last_accepted(kind, booking.robot_id, booking=str(booking.pk))
        for kind in ("recording.begin", "recording.end")
    )
    if ended is None or ended.actor_id is None or (begun is not None and begun.pk > ended.pk):
        log.warning("The recording of booking %s broke off, and is begun again.", booking.pk)
        Booking.objects.filter(pk=booking.pk).update(recorded_until=now)


def _end(booking: Booking, now: datetime) -> None:
    """End the recording of a slot that ends earlier. Raises `NotDone`."""
    if booking.held_until > now:
        return
    goes_on = going_on(booking.robot)
    if goes_on is not None and goes_on.kind == "booking":
        carry_out(booking.robot, LinkRecordEnd(goes_on.recording), booking=str(booking.pk))
    Booking.objects.filter(pk=booking.pk).update(recorded_until=now)


def _is_of(booking: Booking) -> bool:
    """Return whether the recording that goes on was begun for this booking."""
    begun = last_accepted("recording.begin", booking.robot_id)
    return begun is not None and begun.parameters.get("booking") == str(booking.pk)
