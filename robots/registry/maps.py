"""Robots' maps, each with its time span. They show rooms, no people."""

from __future__ import annotations

from datetime import datetime, timedelta
from uuid import UUID

from django.db import transaction

from robots.bridge.audit.record_sink import TakenMap
from robots.registry.models import RobotMap

CLOCKS = timedelta(minutes=5)  # of the bridge's computer and of others: they may differ by that much


@transaction.atomic
def map_seen(robot_id: UUID, taken: TakenMap, now: datetime) -> RobotMap:
    """Store the robot's current map. Only the robot's one bridge calls this, so no two calls run at once.

    Which was told last, their numbers tell: a clock may have been ahead. A row that begins in days to come is shown
    with no session until then, so another one goes on for it.
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
