"""Stores the newest description of each robot."""

from __future__ import annotations

from datetime import datetime
from uuid import UUID

from robots.registry.models import RobotDescription
from robots.shared.records.record_sink import TakenDescription


def description_store(robot_id: UUID, taken: TakenDescription, now: datetime) -> None:
    """Store the robot's current description. Only the robot's one bridge calls this."""
    RobotDescription.objects.update_or_create(
        robot_id=robot_id,
        defaults={
            "digest": taken.digest,
            "seen_at": now,
            "packed": taken.packed,
            "problem": taken.problem,
        },
    )
