"""Turns on a robot that nobody controls: call the next person, note who did not come.

The robot's hub calls it at its regular reads; housekeeping does so where no page of the robot is open, and a change
of the line does it at once.
"""

from __future__ import annotations

import logging
from datetime import datetime
from typing import Any
from uuid import UUID

from django.dispatch import receiver
from django.utils import timezone

from fleet.bookings.lessons.turns import line_changed, turns_due, turns_step
from teleop.control.changes import ControlRefused, recorded_change, robot_locked
from teleop.control.lease_checks import is_free
from teleop.control.selectors import lease_of

log = logging.getLogger(__name__)


def turns_settle(*, robot_id: UUID, now: datetime) -> bool:
    """Do what is due in the present lesson's line, if nobody has control. Return whether something changed."""
    with recorded_change():
        robot = robot_locked(robot_id)
        return is_free(lease_of(robot_id), now) and turns_step(robot=robot, now=now)


def turns_settle_all(now: datetime) -> None:
    """Settle the lines of all robots on which somebody waits for a turn."""
    for robot_id in turns_due(now).values_list("pk", flat=True):
        settle_or_log(robot_id, now)


def settle_or_log(robot_id: UUID, now: datetime) -> bool:
    """Settle a line; a failure is only logged, because the next read tries again."""
    try:
        return turns_settle(robot_id=robot_id, now=now)
    except ControlRefused as error:
        log.warning("The line of robot %s was not settled and is tried again: %s", robot_id, error)
        return False


@receiver(line_changed)
def _line_changed(*, robot_id: UUID, **_options: Any) -> None:
    settle_or_log(robot_id, timezone.now())
