"""Recordings by hand end with the time for which they were begun, and with the right of who began them.

The bridge knows only how long that time was to last. Housekeeping ends a recording if the slot ends earlier, if
somebody books the free time in which it was begun, or if its person may not drive the robot any more.
"""

from __future__ import annotations

import logging
import time
from datetime import datetime, timedelta
from uuid import UUID

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.bookings.schedule import schedule_of
from robots.access.selectors import role_on
from robots.registry.models import Robot, Role
from robots.shared.wire import LinkRecordEnd, NotDone
from robots.shared.wire.recordings import LONGEST_RECORDING_S
from teleop.recordings.orders.housekeeping import carry_out, going_on, last_accepted

log = logging.getLogger(__name__)

LOOK_S = 10.0  # between two looks


class HandRecordings:
    """Ends recordings by hand, for one housekeeping process."""

    def __init__(self) -> None:
        self._look_at_s = 0.0
        self._over: dict[UUID, int] = {}  # by robot: the begin of the last one that is known to be over

    def step(self, now: datetime) -> None:
        """End what is over."""
        if time.monotonic() < self._look_at_s:
            return
        self._look_at_s = time.monotonic() + LOOK_S
        for robot in _recorded_lately(now):
            begun = last_accepted("recording.begin", robot.pk)
            if begun is None or begun.actor_id is None or self._over.get(robot.pk) == begun.pk:
                continue
            if (why := _why_over(begun, robot, now)) is None:
                continue
            try:
                goes_on = going_on(robot)
                if goes_on is not None and goes_on.kind == "by_hand":
                    carry_out(robot, LinkRecordEnd(goes_on.recording), because=why)
                self._over[robot.pk] = begun.pk
            except NotDone as refused:
                log.warning("The recording of %s is not ended yet: %s", robot, refused)


def _recorded_lately(now: datetime) -> list[Robot]:
    """Return the robots on which a person began a recording that may go on."""
    since = now - timedelta(seconds=LONGEST_RECORDING_S)
    begun = Record.objects.filter(kind="recording.begin", at__gt=since, outcome="accepted")
    robots = begun.exclude(actor=None).values_list("robot_id", flat=True)
    return list(Robot.objects.filter(pk__in={robot for robot in robots if robot}, enabled=True))


def _why_over(begun: Record, robot: Robot, now: datetime) -> str | None:
    """Return why a recording must end now; None: it may go on."""
    person = User.objects.filter(pk=begun.actor_id or "").first()
    role = role_on(person, robot, now) if person is not None else None
    if role is None or role < Role.OPERATOR:
        return "right"
    current = schedule_of(robot, now).current
    booking = begun.parameters.get("booking", "")
    if current is None:
        return "slot" if booking else None
    is_theirs = not booking and str(current.person) == begun.actor_id
    return None if str(current.id) == booking or is_theirs else "slot"
