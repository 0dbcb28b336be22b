"""An unchanged map of a robot is stored once."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest

from robots.registry.maps import map_store
from robots.registry.models import Robot
from robots.shared.geometry.poses import Pose
from robots.shared.records.record_sink import TakenMap

pytestmark = pytest.mark.django_db

NOON = datetime(2026, 11, 17, 12, 0, tzinfo=UTC)


def test_a_clock_once_ahead_does_not_repeat_map_rows(robot: Robot) -> None:
    def seen(what: str, moment: datetime) -> None:
        map_store(robot.pk, TakenMap(0.05, Pose(0.0, 0.0, 0.0), 1, 1, what.encode(), what), moment)

    seen("a", NOON + timedelta(days=3650))
    for minutes in (0, 5, 10):
        seen("b", NOON + timedelta(minutes=minutes))
    _, newer = robot.maps.order_by("pk")
    assert (newer.digest, newer.first_seen_at) == ("b", NOON)
    assert newer.last_seen_at == NOON + timedelta(minutes=10)
