"""Time that people drove in lessons, from their control sessions."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from typing import Any
from uuid import UUID

from django.db.models import Q, QuerySet

from fleet.accounts.models import User
from fleet.bookings.models import Booking
from fleet.bookings.rules import Slot
from robots.registry.models import Robot


def driven(
    lessons: QuerySet[Booking], now: datetime, person: User | None = None
) -> Iterator[tuple[UUID, Slot]]:
    """Yield who drove in these lessons, and when; of one person, if given.

    Sessions are read by a relation of the robot, because their app, `teleop`, is above this one.
    """
    begun = lessons.filter(starts_at__lt=now).order_by("robot", "starts_at")
    for robot_id, starts, ends in begun.values_list("robot_id", "starts_at", "held_until"):
        sessions: QuerySet[Any] = Robot(pk=robot_id).control_sessions.filter(
            Q(ended_at=None) | Q(ended_at__gt=starts), started_at__lt=ends
        )
        if person is not None:
            sessions = sessions.filter(user=person)
        for who, began, ended in sessions.values_list("user_id", "started_at", "ended_at"):
            yield who, Slot(max(began, starts), min(ended or now, ends))
