"""Reads diagnostic_msgs/DiagnosticArray, within limits."""

from __future__ import annotations

from itertools import islice
from typing import Any

from robots.bridge.health.diagnostics import Status
from robots.bridge.ros.bounds.texts import SENTENCE, TITLE, cut

MOST_STATUSES = 500  # of one message
MOST_VALUES = 100  # of one status
LONGEST_VALUE = 40  # characters; temperatures are short


def statuses(message: Any) -> list[Status]:
    """Return the statuses of one message, with texts cut."""
    return [
        Status(
            cut(one.name, TITLE),
            one.level if isinstance(one.level, int) else int.from_bytes(one.level, "little"),
            cut(one.message, SENTENCE),
            [(cut(value.key, TITLE), cut(value.value, LONGEST_VALUE)) for value in one.values[:MOST_VALUES]],
        )
        for one in islice(message.status, MOST_STATUSES)
    ]
