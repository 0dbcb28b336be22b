"""Robots as they are in the registry now.

A robot whose page is open is read twice a second. Django takes 3 ms to build the robot's models and to check its entry,
so the results are kept until the robot's rows change.
"""

from __future__ import annotations

from typing import Any
from uuid import UUID

from msgspec import Struct

from fleet.base.database import rows
from robots.registry.configuration import robot_config
from robots.registry.models import Robot
from robots.registry.selectors import allowed_on, robot_facts
from robots.shared.configuration.bridge_config import Allowed, Topics
from robots.shared.wire import RobotFacts

_ROBOT = (
    "SELECT r.*, p.* FROM robots_robot r JOIN robots_robotprofile p ON p.id = r.profile_id WHERE r.id = %s"
)
_ALLOWED = """
SELECT * FROM robots_allowance
WHERE robot_id = %s OR profile_id = (SELECT profile_id FROM robots_robot WHERE id = %s) ORDER BY id
"""


class KnownRobot(Struct, frozen=True):
    """A robot and its checked entry. Threads share it: do not change the models."""

    robot: Robot  # with its profile
    facts: RobotFacts
    allowed: tuple[Allowed, ...]  # empty if the entry is wrong
    topics: Topics | None  # None if the entry is wrong


_Rows = tuple[list[tuple[Any, ...]], list[tuple[Any, ...]]]
_known: dict[UUID, tuple[_Rows, KnownRobot]] = {}


def known_robot(robot_id: UUID) -> KnownRobot | None:
    """Return the robot as it is stored now; None if it was deleted. Makes two queries if nothing changed."""
    stored = _read(robot_id)
    before = _known.get(robot_id)
    if before is not None and before[0] == stored:
        return before[1]
    _known.pop(robot_id, None)
    robot = Robot.objects.select_related("profile").filter(pk=robot_id).first()
    if robot is None:
        return None
    wrong = bool(robot.problems)
    topics = None if wrong else robot_config.topics(robot)
    known = KnownRobot(robot, robot_facts(robot), () if wrong else allowed_on(robot), topics)
    if _read(robot_id) == stored:  # otherwise the rows changed before `known` was built
        _known[robot_id] = stored, known
    return known


def known_robot_at(slug: str) -> KnownRobot | None:
    """Return the robot with this slug; see `known_robot`."""
    found = rows.read("SELECT id FROM robots_robot WHERE slug = %s", [slug])
    return known_robot(rows.key(found[0][0])) if found else None


def _read(robot_id: UUID) -> _Rows:
    return rows.read(_ROBOT, [robot_id]), rows.read(_ALLOWED, [robot_id, robot_id])
