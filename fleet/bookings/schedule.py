"""The schedules of robots for control.

One hand-written query reads them twice a second and when control is taken.
"""

from __future__ import annotations

from collections.abc import Collection
from datetime import datetime, timedelta
from typing import Any
from uuid import UUID

import msgspec
from msgspec import Struct, convert

from fleet.base.database import rows
from fleet.bookings.models import OutOfService, Policy, Shared, State
from fleet.bookings.rules import FAR, LONGEST, Slot, Taken
from fleet.bookings.selectors import held_slot, why_out
from robots.registry.models import Robot
from robots.shared.wire import LessonTasks

AHEAD = timedelta(days=1)
CALL_S = 90.0  # a called person who does not take control for this time has missed the call
GAP = timedelta(minutes=1)  # a shorter time between two bookings does not count as free

_DEFAULTS = (timedelta(minutes=Policy().grace_min), Policy().free_time)  # without any policy

# Kinds of rows, in their order; the first policy of a robot counts
_OWN, _OF_GROUP, _OF_ALL, _BOOKING, _OUT = range(5)

_NO_TURN = ", ".join(["NULL"] * 11)  # the columns of a shared booking and its turn
_ROWS = f"""
SELECT {_BOOKING} AS kind, robot_id, starts_at, held_until, used_at, made_at, b.id, b.person_id,
    COALESCE(NULLIF(u.full_name, ''), u.username) AS name, '' AS note, 0 AS grace_min, TRUE AS free_time,
    b.shared, c.name AS course, b.turn_min, b.line_held,
    t.id AS turn, t.person_id AS turns, COALESCE(NULLIF(d.full_name, ''), d.username) AS driver,
    t.called_at, t.ends_at AS turn_ends_at, t.left_s, b.tasks
FROM bookings_booking b JOIN accounts_user u ON u.id = b.person_id
    LEFT JOIN access_course c ON c.id = b.course_id AND b.shared = '{Shared.COURSE.value}'
    LEFT JOIN bookings_turn t ON t.booking_id = b.id AND t.state IN ('called', 'driving')
    LEFT JOIN accounts_user d ON d.id = t.person_id
WHERE robot_id IN ({{robots}}) AND starts_at > %s AND starts_at < %s AND held_until > %s AND held_until > starts_at
    AND b.state NOT IN ('{State.AWAITING.value}', '{State.OFFERED.value}')
UNION ALL
SELECT {_OUT}, robot_id, starts_at, ends_at, NULL, NULL, NULL, NULL, why, note, 0, TRUE,
    {_NO_TURN}
FROM bookings_outofservice
WHERE robot_id IN ({{robots}}) AND starts_at < %s AND (ends_at IS NULL OR ends_at > %s)
UNION ALL
SELECT CASE WHEN robot_id IS NULL THEN {_OF_ALL} ELSE {_OWN} END, robot_id, NULL, NULL, NULL, NULL, NULL, NULL,
    '', '', grace_min, free_time, {_NO_TURN}
FROM bookings_policy
WHERE robot_id IN ({{robots}}) OR (robot_id IS NULL AND group_id IS NULL)
UNION ALL
SELECT {_OF_GROUP}, gr.robot_id, NULL, NULL, NULL, NULL, NULL, NULL, g.name, '', grace_min, free_time, {_NO_TURN}
FROM bookings_policy p JOIN access_robotgroup g ON g.id = p.group_id
    JOIN access_robotgroup_robots gr ON gr.robotgroup_id = g.id
WHERE gr.robot_id IN ({{robots}})
ORDER BY kind, starts_at, name
"""  # noqa: S608  # no part of it comes from outside


def call_left_s(called_at: datetime | None, now: datetime) -> float:
    """Return for how many more seconds a person who was called may take control.

    Who asks may have read the clock, or waited for a lock, before another process called. If the clock is set back
    by more than a call lasts: none.
    """
    called_s = (now - called_at).total_seconds() if called_at else CALL_S
    return min(max(CALL_S - called_s, 0.0), CALL_S) if called_s > -CALL_S else 0.0


class Called(Struct, frozen=True):
    """The turn of a shared booking at a moment: its person is called, or drives."""

    id: int
    person: UUID
    name: str
    called_at: datetime | None
    ends_at: datetime | None  # None: called, not driving yet
    left_s: int  # a called person may drive for so long

    def until(self, now: datetime) -> datetime:
        """Return the end of the turn; of a person who is only called, if they began now."""
        return self.ends_at or now + timedelta(seconds=self.left_s)

    def call_left_s(self, now: datetime) -> float:
        """Return for how many more seconds a called person may take control."""
        return call_left_s(self.called_at, now)


class Held(Struct, frozen=True):
    """A booking that holds the robot."""

    id: UUID
    person: UUID
    name: str
    slot: Slot
    booked_at: datetime
    used: bool = True  # its person has taken control in it
    lapses_at: datetime | None = None  # the slot is free again then, unless its person has taken control
    shared: str = ""  # a `models.Shared`
    course: str = ""  # the name of the course of a lesson
    turn_min: int | None = None  # length of a turn; None: no turns
    line_held: bool = False  # nobody is called now
    turn: Called | None = None
    tasks: LessonTasks | None = None  # what its members may do; None: everything

    @property
    def whose(self) -> str:
        """Return the name of the course of a lesson, else of the person."""
        return self.course or self.name

    @property
    def holds_from(self) -> datetime:
        """Return its start, or the time when it was booked if that is later."""
        return max(self.slot.starts_at, self.booked_at)


class Schedule(Struct, frozen=True):
    """The bookings of one robot at a moment, for control."""

    current: Held | None = None
    next: tuple[Held, ...] = ()  # bookings that begin later, earliest first
    free_time: bool = True  # the policy lets people take control in time that nobody booked
    out: Taken | None = None  # the out-of-service period of this moment
    out_next: Taken | None = None  # the next out-of-service period that begins later

    def free_from(self, now: datetime) -> datetime | None:
        """Return the start of the robot's next free time of a minute or more; None: not within `AHEAD`."""
        moment = self.out.slot.ends_at if self.out else now
        busy = [one.slot for one in (self.current, *self.next, self.out_next) if one is not None]
        for slot in sorted(busy, key=lambda one: one.starts_at):
            if slot.starts_at - GAP < moment:  # `moment` may be `FAR`: nothing can be added to it
                moment = max(moment, slot.ends_at)
        return moment if moment < now + AHEAD else None


def schedule_of(robot: Robot, now: datetime) -> Schedule:
    """Return the robot's schedule for now and the next 24 hours. One query."""
    return schedules_of([robot], now)[robot.id]


def schedules_of(robots: Collection[Robot], now: datetime) -> dict[UUID, Schedule]:
    """Return `schedule_of` for many robots. One query."""
    policies: dict[UUID | None, tuple[timedelta, bool]] = {}  # by robot, None: all; grace time, free time
    held: dict[UUID, list[Held]] = {robot.id: [] for robot in robots}
    out: dict[UUID, list[Taken]] = {robot.id: [] for robot in robots}

    def policy(robot: UUID) -> tuple[timedelta, bool]:
        return policies.get(robot) or policies.get(None) or _DEFAULTS

    for (
        kind,
        of,
        starts_at,
        ends_at,
        used_at,
        made_at,
        key,
        person,
        name,
        note,
        grace_min,
        free,
        *sharing,
    ) in _read(held, now):
        robot = of and rows.key(of)
        if kind == _BOOKING:
            times = _Times(rows.moment(starts_at), rows.moment(ends_at), used_at and rows.moment(used_at))
            grace, _ = policy(robot)
            held[robot].append(
                Held(
                    rows.key(key),
                    rows.key(person),
                    name,
                    held_slot(times, grace, now),
                    rows.moment(made_at),
                    used_at is not None,
                    None if used_at else times.starts_at + grace,
                    *_sharing(sharing),
                )
            )
        elif kind == _OUT:
            ends = rows.moment(ends_at) if ends_at else FAR
            why = why_out(OutOfService(why=name, note=note))
            out[robot].append(Taken(Slot(rows.moment(starts_at), ends), why))
        else:
            policies.setdefault(robot, (timedelta(minutes=grace_min), bool(free)))
    return {
        robot: Schedule(
            next((one for one in slots if one.slot.starts_at <= now < one.slot.ends_at), None),
            tuple(one for one in slots if one.slot.starts_at > now),
            policy(robot)[1],
            max(
                (one for one in out[robot] if one.slot.starts_at <= now),
                key=lambda one: one.slot.ends_at,
                default=None,
            ),
            next((one for one in out[robot] if one.slot.starts_at > now), None),
        )
        for robot, slots in held.items()
    }


def _sharing(columns: list[Any]) -> tuple[str, str, int | None, bool, Called | None, LessonTasks | None]:
    """Return the fields of `Held` about a shared booking."""
    shared, course, turn_min, line_held, key, person, name, called_at, ends_at, left_s, tasks = columns
    turn = key and Called(
        key,
        rows.key(person),
        name,
        called_at and rows.moment(called_at),
        ends_at and rows.moment(ends_at),
        60 * (turn_min or 0) if left_s is None else left_s,
    )
    return shared, course or "", turn_min, bool(line_held), turn or None, tasks_of(tasks)


def tasks_of(stored: Any) -> LessonTasks | None:
    """Return the stored tasks of a lesson as a value: a query by hand reads them as text, a model as JSON."""
    if stored is None:
        return None
    return (
        msgspec.json.decode(stored, type=LessonTasks)
        if isinstance(stored, str)
        else convert(stored, LessonTasks)
    )


class _Times(Struct):
    """The times of a booking."""

    starts_at: datetime
    held_until: datetime
    used_at: datetime | None


def _read(robots: Collection[UUID], now: datetime) -> list[tuple[Any, ...]]:
    if not robots:
        return []
    query = _ROWS.format(robots=rows.marks(robots))
    bookings = (*robots, now - LONGEST, now + AHEAD, now)
    return rows.read(query, (*bookings, *robots, now + AHEAD, now, *robots, *robots))
