"""Reads diagnostic_msgs/DiagnosticArray, within limits."""

from __future__ import annotations

from heapq import nlargest
from typing import Any

from robots.bridge.health.diagnostics import Status
from robots.shared.texts import SENTENCE, TITLE, cut

MOST_STATUSES = 500  # of one message
MOST_VALUES = 100  # of one status
LONGEST_VALUE = 40  # characters; temperatures are short


def statuses(message: Any, node: str) -> list[Status]:
    """Return the statuses of a node's message, with texts cut; of too many the worst."""
    node = cut(node, TITLE)
    return [
        Status(
            cut(one.name, TITLE),
            _level(one),
            cut(one.message, SENTENCE),
            [(cut(value.key, TITLE), cut(value.value, LONGEST_VALUE)) for value in one.values[:MOST_VALUES]],
            cut(one.hardware_id, TITLE),
            node,
        )
        for one in nlargest(MOST_STATUSES, message.status, key=_level)
    ]


def _level(status: Any) -> int:
    """Return the level: rospy reads a number, rclpy a byte."""
    return status.level if isinstance(status.level, int) else int.from_bytes(status.level, "little")
