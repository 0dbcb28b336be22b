"""Select the map to show with a control session, and remove maps that no session needs any more."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta
from itertools import zip_longest
from uuid import UUID

from django.conf import settings
from django.db.models import Q, QuerySet
from django.utils import timezone

from robots.places.models import SharedMap
from robots.places.selectors import USED
from robots.registry.maps import CLOCKS
from robots.registry.models import Robot, RobotMap
from teleop.models import ControlSession

RECENT = timedelta(days=1)  # a map seen within this time may still be needed


def maps_of(session: ControlSession) -> QuerySet[RobotMap]:
    """Return the robot's maps during a control session, newest last. The newest is shown."""
    maps = RobotMap.objects.filter(
        robot=session.robot_id,
        first_seen_at__lte=session.ended_at or timezone.now(),
        last_seen_at__gte=session.started_at - CLOCKS,
    )
    return maps.order_by("first_seen_at")


def remove_unneeded(now: datetime) -> Iterator[None]:
    """Remove maps that belong to no control session whose paths are kept. One step per robot.

    If a map has places, its newest row is kept.
    """
    for robot_id in Robot.objects.filter(maps__isnull=False).distinct().values_list("pk", flat=True):
        RobotMap.objects.filter(pk__in=_unneeded(robot_id, now)).delete()
        yield


def _unneeded(robot_id: UUID, now: datetime) -> list[int]:
    kept_since = now - timedelta(days=settings.FLEET_AUDIT_KEEP_DAYS["driving"] + 1)
    sessions = ControlSession.objects.filter(robot=robot_id).exclude(ended_at__lt=kept_since)
    maps = list(RobotMap.objects.filter(robot=robot_id).defer("picture").order_by("first_seen_at"))
    shared = SharedMap.objects.filter(USED, digest__in={found.digest for found in maps})
    newest = {found.digest: found.pk for found in maps}
    kept = {newest[digest] for digest in shared.values_list("digest", flat=True)}
    return [
        found.pk
        for found, following in zip_longest(maps, maps[1:])
        if found.last_seen_at < now - RECENT
        and found.pk not in kept
        and not _shown_with(sessions, found, following).exists()
    ]


def _shown_with(
    sessions: QuerySet[ControlSession], found: RobotMap, following: RobotMap | None
) -> QuerySet[ControlSession]:
    """Return the sessions that show this map and not the following one: the inverse of `maps_of`."""
    begun = sessions.filter(started_at__lte=found.last_seen_at + CLOCKS)
    if following is not None:
        return begun.filter(ended_at__gte=found.first_seen_at, ended_at__lt=following.first_seen_at)
    return begun.filter(Q(ended_at__gte=found.first_seen_at) | Q(ended_at=None))
