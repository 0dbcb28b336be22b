"""Robots' maps, each with the time in which the robot had it. Maps show rooms, not people."""

from __future__ import annotations

from datetime import datetime, timedelta
from uuid import UUID

from django.db import transaction

from robots.registry.models import RobotMap
from robots.shared.records.record_sink import TakenMap

CLOCKS = timedelta(minutes=5)  # allowed difference between the clock of the bridge's computer and others


@transaction.atomic
def map_store(robot_id: UUID, taken: TakenMap, now: datetime) -> RobotMap:
    """Store the robot's current map. Only the robot's one bridge calls this, so no two calls run at the same time.

    The newest map is the row with the highest key; times are not reliable, because a clock may have been ahead. If the
    newest row begins in the future, sessions before that time would show no map: so write a new row for the same map.
    """
    newest = RobotMap.objects.filter(robot_id=robot_id).defer("picture").order_by("pk").last()
    if newest is not None and newest.digest == taken.digest and newest.first_seen_at <= now + CLOCKS:
        newest.last_seen_at = max(now, newest.last_seen_at)
        newest.save(update_fields=["last_seen_at"])
        return newest
    return RobotMap.objects.create(
        robot_id=robot_id,
        digest=taken.digest,
        first_seen_at=now,
        last_seen_at=now,
        resolution_m=taken.resolution_m,
        origin_x_m=taken.origin.x,
        origin_y_m=taken.origin.y,
        origin_yaw=taken.origin.yaw,
        width=taken.width,
        height=taken.height,
        picture=taken.picture,
    )
