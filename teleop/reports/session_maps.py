"""Which of a robot's maps is shown with a control session, and which no session needs any more."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta
from itertools import zip_longest
from uuid import UUID

from django.conf import settings
from django.db.models import Q, QuerySet
from django.utils import timezone

from robots.registry.maps import CLOCKS
from robots.registry.models import Robot, RobotMap
from teleop.models import ControlSession

UNDER_WAY = timedelta(days=1)  # what was seen within that may still be wanted


def maps_of(session: ControlSession) -> QuerySet[RobotMap]:
    """What the robot's map was while somebody had control, the newest last: that one is shown."""
    maps = RobotMap.objects.filter(
        robot=session.robot_id,
        first_seen_at__lte=session.ended_at or timezone.now(),
        last_seen_at__gte=session.started_at - CLOCKS,
    )
    return maps.order_by("first_seen_at")


def keep_house(now: datetime) -> Iterator[None]:
    """Remove the maps that are shown with no control session whose paths are kept. A step for each robot."""
    for robot_id in Robot.objects.filter(maps__isnull=False).distinct().values_list("pk", flat=True):
        RobotMap.objects.filter(pk__in=_unneeded(robot_id, now)).delete()
        yield


def _unneeded(robot_id: UUID, now: datetime) -> list[int]:
    kept_since = now - timedelta(days=settings.FLEET_AUDIT_KEEP_DAYS["driving"] + 1)
    sessions = ControlSession.objects.filter(robot=robot_id).exclude(ended_at__lt=kept_since)
    maps = list(RobotMap.objects.filter(robot=robot_id).defer("picture").order_by("first_seen_at"))
    return [
        found.pk
        for found, following in zip_longest(maps, maps[1:])
        if found.last_seen_at < now - UNDER_WAY and not _shown_with(sessions, found, following).exists()
    ]


def _shown_with(
    sessions: QuerySet[ControlSession], found: RobotMap, following: RobotMap | None
) -> QuerySet[ControlSession]:
    """Those that show this map, and not the following one; as `maps_of`, the other way round."""
    begun = sessions.filter(started_at__lte=found.last_seen_at + CLOCKS)
    if following is not None:
        return begun.filter(ended_at__gte=found.first_seen_at, ended_at__lt=following.first_seen_at)
    return begun.filter(Q(ended_at__gte=found.first_seen_at) | Q(ended_at=None))
