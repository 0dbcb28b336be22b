"""Holidays of the lab: add and remove them."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import date
from typing import Any
from uuid import UUID

from django.db import transaction
from django.utils import timezone
from msgspec import Struct

from fleet.accounts.models import User
from fleet.audit.services import record
from fleet.bookings.losses.weighing import hours_watched
from fleet.bookings.models import Holiday
from fleet.bookings.services import robots_locked
from robots.registry.models import Robot

MOST = 500  # entries of a file


class Entry(Struct, frozen=True, order=True):
    """A holiday that is not stored yet."""

    first_day: date
    last_day: date
    name: str


@transaction.atomic
def holidays_add(entries: Iterable[Entry], *, actor: User) -> list[Holiday]:
    """Add holidays; leave out those that are stored already. Raises `ValidationError`.

    All robots are locked: nobody may book these days meanwhile.
    """
    made, robots, now = [], list(Robot.objects.all()), timezone.now()
    with robots_locked([robot.pk for robot in robots], now), hours_watched(robots, now):
        for one in new_among(entries):
            holiday = Holiday(name=one.name, first_day=one.first_day, last_day=one.last_day)
            holiday.full_clean()
            holiday.save()
            record("holiday.add", actor=actor, **_facts(holiday))
            made.append(holiday)
    return made


@transaction.atomic
def holiday_remove(*, holiday_id: UUID, actor: User) -> None:
    """Remove a holiday, if it is still there: people who wait for its days get them."""
    with robots_locked(Robot.objects.values_list("pk", flat=True), timezone.now()):
        for holiday in Holiday.objects.filter(pk=holiday_id):
            record("holiday.remove", actor=actor, **_facts(holiday))
            holiday.delete()


def new_among(entries: Iterable[Entry]) -> list[Entry]:
    """Return the entries that are not stored, each once, in order."""
    stored = set(Holiday.objects.values_list("first_day", "name"))
    return sorted(one for one in set(entries) if (one.first_day, one.name) not in stored)


def _facts(holiday: Holiday) -> dict[str, Any]:
    days = {"from": holiday.first_day.isoformat(), "to": holiday.last_day.isoformat()}
    return {"parameters": days, "private": {"name": holiday.name}}
