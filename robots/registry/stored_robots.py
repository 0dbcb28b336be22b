"""All robots as they are stored. One query tells whether they changed; only then are they read and checked again.

Fleet pages read them every two seconds, the fleet supervisor twice a second.
"""

from __future__ import annotations

from functools import cache
from itertools import chain, repeat
from typing import Any

from django.db.models import Model

from fleet.base.database import rows
from robots.registry.models import Allowance, Robot, RobotProfile

_KINDS: tuple[type[Model], ...] = (Robot, RobotProfile, Allowance)
# No part of a robot's configuration: the fence changes whenever somebody takes control
_LEFT_OUT = {"fence", "updated_at", "shipped", "shipped_phrases"}


class StoredRobots:
    """All robots with their profiles, by name. Do not change the models."""

    def __init__(self) -> None:
        self.robots: list[Robot] = []
        self._content: list[tuple[Any, ...]] | None = None

    def read(self) -> bool:
        """Read the robots. Return whether a robot, a profile or an allow-list changed since the last call."""
        content = rows.read(_content_query(), [])
        if content == self._content:
            return False
        self.robots = list(Robot.objects.select_related("profile"))
        self._content = content  # it is not newer than `robots`
        return True


@cache
def _content_query() -> str:
    """Return a query for the content of all rows of `_KINDS`, as texts."""
    columns = {
        kind: [field.column for field in kind._meta.concrete_fields if field.name not in _LEFT_OUT]
        for kind in _KINDS
    }
    most = max(map(len, columns.values()))
    parts = []
    for number, (kind, names) in enumerate(columns.items()):
        texts = (f'CAST("{name}" AS TEXT)' for name in names)
        padded = chain(texts, repeat("NULL", most - len(names)))
        parts.append(f"SELECT {number}, {', '.join(padded)} FROM {kind._meta.db_table}")  # noqa: S608
    return " UNION ALL ".join(parts) + " ORDER BY 1, 2"
