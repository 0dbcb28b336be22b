"""Reads all sources of roles, and the qualifications that robots demand, by hand-written SQL.

The rights of everybody who has a robot's page open are read twice a second. Django takes 10 ms to build the query for
roles; the database answers it in 0.1 ms.
"""

from __future__ import annotations

from collections.abc import Collection
from datetime import date
from uuid import UUID

from msgspec import Struct

from fleet.base.database import rows
from robots.registry.models import Role

OWN = 0  # instead of a course's key: the role was given on the robot, or on a group with this robot

_GIVEN = """
WITH covered (course_id, robot_id) AS (
    SELECT course_id, robot_id FROM access_course_robots
    UNION
    SELECT cg.course_id, gr.robot_id
    FROM access_course_groups cg JOIN access_robotgroup_robots gr ON gr.robotgroup_id = cg.robotgroup_id
), valid (id, role, begun) AS (
    SELECT id, role, starts_on <= {day} FROM access_course
    WHERE NOT archived AND starts_on <= {last} AND ends_on >= {day}
)
SELECT user_id, robot_id, role, 0, TRUE, 0 FROM robots_robotrole WHERE user_id IN ({people}) AND {on_robots}
UNION ALL
SELECT user_id, robot_id, role, 0, TRUE, g.group_id
FROM access_grouprole g JOIN access_robotgroup_robots gr ON gr.robotgroup_id = g.group_id
WHERE user_id IN ({people}) AND {on_robots}
UNION ALL
SELECT person_id, robot_id, role, valid.id, valid.begun, 0
FROM access_enrolment e JOIN valid ON valid.id = e.course_id JOIN covered ON covered.course_id = e.course_id
WHERE person_id IN ({people}) AND {on_robots}
UNION ALL
SELECT user_id, robot_id, 'supervisor', valid.id, valid.begun, 0
FROM access_course_supervisors s JOIN valid ON valid.id = s.course_id JOIN covered ON covered.course_id = s.course_id
WHERE user_id IN ({people}) AND {on_robots}
"""

_DEMANDED = """
SELECT robot_id, qualification_id FROM access_qualification_robots WHERE robot_id IN ({robots})
UNION
SELECT gr.robot_id, qualification_id
FROM access_qualification_groups qg JOIN access_robotgroup_robots gr ON gr.robotgroup_id = qg.robotgroup_id
WHERE gr.robot_id IN ({robots})
"""


class Given(Struct, frozen=True):
    """One source of a role."""

    person: UUID
    robot: UUID
    role: Role
    course: int  # `OWN` or the course's key
    begun: bool = True  # False: of a course that begins later
    group: int = OWN  # the key of the robot group on which staff gave it


def given(
    people: Collection[UUID], robots: Collection[UUID] | None, day: date, last: date | None = None
) -> list[Given]:
    """Return every role of these people on these robots (None: on all) from `day` to `last`. Makes one query."""
    if not people or (robots is not None and not robots):
        return []
    on_robots = "1 = 1" if robots is None else f"robot_id IN ({rows.marks(robots)})"
    query = _GIVEN.format(day="%s", last="%s", people=rows.marks(people), on_robots=on_robots)
    found = rows.read(query, [day, last or day, day, *[*people, *(robots or ())] * 4])
    return [
        Given(rows.key(person), rows.key(robot), Role(role), course, bool(begun), group)
        for person, robot, role, course, begun, group in found
    ]


def demanded(robot: UUID) -> set[int]:
    """Return the keys of the qualifications that the robot or one of its groups demands. Makes one query."""
    return demanded_by([robot])[robot]


def demanded_by(robots: Collection[UUID]) -> dict[UUID, set[int]]:
    """Return `demanded` of each robot. Makes one query."""
    keys: dict[UUID, set[int]] = {robot: set() for robot in robots}
    for robot, key in (
        rows.read(_DEMANDED.format(robots=rows.marks(robots)), [*robots, *robots]) if robots else ()
    ):
        keys[rows.key(robot)].add(key)
    return keys
