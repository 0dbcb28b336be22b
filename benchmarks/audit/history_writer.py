"""Years of an invented lab: valid records, chained as in `fleet.audit`, written in large batches.

Some robots and people are busy and some are not. Events that are rare in a lab are rare here.
"""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, date, datetime, timedelta
from itertools import islice
from typing import Any
from uuid import UUID

from django.db import connection, transaction
from django.db.models import Model
from msgspec import Struct

from benchmarks.audit.invented_lab import Event, Scenes
from fleet.accounts.models import User
from fleet.audit.integrity.canonical import NO_ROBOT, content_digest, first_digest, next_digest, plain
from fleet.audit.models import Actor, Chain, Content, Record
from robots.registry.models import Robot, RobotProfile
from teleop.models import ControlSession

BATCH_SIZE = 10_000  # records in one transaction
CACHE_KB = 400_000  # of SQLite, so that all indexes are in memory
BEGAN = datetime(2023, 11, 1, 8, tzinfo=UTC)
BETWEEN_S = 1300.0  # between two control sessions, on average
EVENT_S = 12.0  # between two records of a control session
SCENES = 6.0  # of a control session, on average
WITHOUT_SESSION = 0.6  # scenes without control for each session
SIGN_INS = 0.5
ROBOTS = [f"TIAGo {number}" for number in range(1, 7)]
ROBOT_WEIGHTS = [50, 20, 15, 10, 4.9, 0.1]
PEOPLE = 300
PEOPLE_WEIGHTS = [1 / number for number in range(1, PEOPLE + 1)]


class RecordRow(Struct):
    """A record: the columns of its table."""

    id: int
    at: datetime
    day: date
    kind: str
    actor_id: str | None
    real_actor_id: str | None
    robot_id: UUID | None
    robot_name: str
    session_id: UUID | None
    fence: int | None
    request_id: UUID
    of_id: int | None
    outcome: str
    parameters: dict[str, Any]
    content_digest: str
    seq: int
    digest: str


class ContentRow(Struct):
    """Expiring part of a record: the columns of its table."""

    record_id: int
    text: str
    data: dict[str, Any]
    salt: str


class Past:
    """The log of a new database, with its robots, people and control sessions; it may grow."""

    def __init__(self, seed: int = 1) -> None:
        chance = random.Random(seed)  # noqa: S311  # a lab, not a secret
        self.robots = {UUID(int=chance.getrandbits(128)): name for name in ROBOTS}
        self.people = {
            str(UUID(int=chance.getrandbits(128))): f"Person {number:03}" for number in range(PEOPLE)
        }
        _register(self.robots, self.people)
        self._count = 0
        self._lab = _Lab(chance, self.robots, self.people)
        self._records = self._lab.records()

    @property
    def newest(self) -> datetime:
        """Return the time of the newest record."""
        return self._lab.at

    def grow(self, count: int) -> None:
        """Write records until this lab has `count` records. Records of other writers do not count."""
        self._lab.chains.look()
        insert = {"sqlite": _insert_into_sqlite, "postgresql": _copy_to_postgresql}[connection.vendor]
        with _much_memory():
            while self._count < count:
                batch = list(islice(self._records, min(BATCH_SIZE, count - self._count)))
                with transaction.atomic():
                    _open_chains({row.robot_id or NO_ROBOT: row.robot_name for row, _kept in batch})
                    insert(Record, [record for record, _kept in batch])
                    insert(Content, [kept for _record, kept in batch if kept])
                    ControlSession.objects.bulk_create(self._lab.sessions_so_far())
                self._count += len(batch)
        if connection.vendor == "postgresql":
            _count_on()


# --- events ---------------------------------------------------------------------------------


class _Chains:
    """The head of each chain, and the next record number."""

    def look(self) -> None:
        """Continue after the existing records."""
        self._number = Record.objects.order_by("-pk").values_list("pk", flat=True).first() or 0
        self._heads: dict[UUID, tuple[int, str]] = {}

    def append(self, row: RecordRow) -> None:
        """Set the record's number, its position in the chain and its digest."""
        chain = row.robot_id or NO_ROBOT
        if chain not in self._heads:
            placed = Record.objects.filter(robot_id=row.robot_id).order_by("-seq")
            self._heads[chain] = placed.values_list("seq", "digest").first() or (0, first_digest(chain))
        seq, digest = self._heads[chain]
        self._number += 1
        row.id, row.seq = self._number, seq + 1
        row.digest = next_digest(digest, row)
        self._heads[chain] = row.seq, row.digest


class _Lab:
    """Control sessions one after the other, and events outside of sessions."""

    def __init__(self, chance: random.Random, robots: dict[UUID, str], people: dict[str, str]) -> None:
        self.at = BEGAN
        self.chains = _Chains()
        self._chance = chance
        self._robots = robots
        self._people = people
        self._scenes = Scenes(chance)
        self._fences = dict.fromkeys(robots, 0)
        self._sessions: list[ControlSession] = []

    def records(self) -> Iterator[tuple[RecordRow, ContentRow | None]]:
        """Yield records without end."""
        while True:
            self.at += timedelta(seconds=self._chance.expovariate(1 / BETWEEN_S))
            if self._chance.random() < SIGN_INS:
                yield from self._played(self._scenes.sign_in(), self._person())
            if self._chance.random() < WITHOUT_SESSION:
                yield from self._played(self._scenes.without_session(), self._person(), self._robot())
            yield from self._session(self._person(), self._robot())

    def sessions_so_far(self) -> list[ControlSession]:
        """Return the sessions that have ended since the last call."""
        ended, self._sessions = self._sessions, []
        return ended

    def _session(self, person: str, robot: UUID) -> Iterator[tuple[RecordRow, ContentRow | None]]:
        self._fences[robot] += 1
        session = ControlSession(
            id=self._identifier(),
            robot_id=robot,
            user_id=UUID(person),
            fence=self._fences[robot],
            started_at=self.at,
        )
        yield from self._played(self._scenes.begin_session(), person, robot, session)
        for _ in range(1 + int(self._chance.expovariate(1 / SCENES))):
            yield from self._played(self._scenes.in_session(), person, robot, session)
        end = self._scenes.end_session(person, self._people[person])
        yield from self._played(end, person, robot, session)
        session.ended_at, session.end_reason = self.at, end[0].outcome
        self._sessions.append(session)

    def _played(
        self,
        events: Iterable[Event],
        person: str,
        robot: UUID | None = None,
        session: ControlSession | None = None,
    ) -> Iterator[tuple[RecordRow, ContentRow | None]]:
        scene: list[RecordRow] = []
        for event in events:
            self.at += timedelta(seconds=self._chance.expovariate(1 / EVENT_S))
            of = scene[-event.of] if event.of else None
            row = RecordRow(
                id=0,
                at=self.at,
                day=self.at.date(),
                kind=event.kind,
                actor_id=None if event.by_console else person,
                real_actor_id=None,
                robot_id=robot,
                robot_name=self._robots[robot] if robot else "",
                session_id=session.id if session else None,
                fence=session.fence if session else None,
                request_id=of.request_id if of else self._identifier(),
                of_id=of.id if of else None,
                outcome=event.outcome,
                parameters=plain(event.parameters),
                content_digest="",
                seq=0,
                digest="",
            )
            kept = None
            if event.text or event.private:
                kept = ContentRow(
                    0, event.text, plain(event.private), f"{self._chance.getrandbits(128):032x}"
                )
                row.content_digest = content_digest(kept.salt, kept.text, kept.data)
            self.chains.append(row)
            if kept:
                kept.record_id = row.id
            scene.append(row)
            yield row, kept

    def _person(self) -> str:
        return self._chance.choices(list(self._people), PEOPLE_WEIGHTS)[0]

    def _robot(self) -> UUID:
        return self._chance.choices(list(self._robots), ROBOT_WEIGHTS)[0]

    def _identifier(self) -> UUID:
        return UUID(int=self._chance.getrandbits(128))


# --- into the database ----------------------------------------------------------------------------


def _register(robots: dict[UUID, str], people: dict[str, str]) -> None:
    """Create robots and people, and their rows in the log."""
    profile = RobotProfile.objects.order_by("pk")[0]
    Robot.objects.bulk_create(
        [
            Robot(id=key, name=name, slug=name.lower().replace(" ", "-"), profile=profile)
            for key, name in robots.items()
        ]
    )
    User.objects.bulk_create(
        [
            User(id=key, full_name=name, username=name.lower().replace(" ", "-"))
            for key, name in people.items()
        ]
    )
    Actor.objects.bulk_create([Actor(id=key, name=name) for key, name in people.items()])


def _open_chains(names: dict[UUID, str]) -> None:
    """Create rows for new chains."""
    Chain.objects.bulk_create(
        [Chain(id=key, name=name) for key, name in names.items()], ignore_conflicts=True
    )


def _insert_into_sqlite(model: type[Model], rows: Sequence[Struct]) -> None:
    """Insert rows, faster than `bulk_create`, which needs a statement for every few dozen rows."""
    columns, cells = _table(model, rows)
    places = ", ".join(["%s"] * columns.count(",")) + ", %s"
    with connection.cursor() as cursor:
        cursor.executemany(f"INSERT INTO {model._meta.db_table} ({columns}) VALUES ({places})", list(cells))  # noqa: S608


def _copy_to_postgresql(model: type[Model], rows: Sequence[Struct]) -> None:
    columns, cells = _table(model, rows)
    connection.ensure_connection()
    with (
        connection.connection.cursor() as cursor,
        cursor.copy(f"COPY {model._meta.db_table} ({columns}) FROM STDIN") as copy,
    ):
        for row in cells:
            copy.write_row(row)


def _table(model: type[Model], rows: Sequence[Struct]) -> tuple[str, Iterator[list[Any]]]:
    """Return the column names, and the cells of each row in the database's types."""
    names = [str(field.column) for field in model._meta.concrete_fields]
    adapt: dict[type, Callable[[Any], Any]] = {dict: json.dumps}
    if connection.vendor == "sqlite":
        adapt |= {
            UUID: lambda value: value.hex,
            datetime: connection.ops.adapt_datetimefield_value,
            date: connection.ops.adapt_datefield_value,
        }
    cells = (
        [
            adapt[type(value)](value) if type(value) in adapt else value
            for value in (getattr(row, name) for name in names)
        ]
        for row in rows
    )
    return ", ".join(names), cells


@contextmanager
def _much_memory() -> Iterator[None]:
    """Context: a large cache while the log grows, because SQLite reads all its indexes again and again."""
    if connection.vendor != "sqlite":
        yield
        return
    with connection.cursor() as cursor:
        usual = cursor.execute("PRAGMA cache_size").fetchone()[0]
        cursor.execute(f"PRAGMA cache_size = -{CACHE_KB}")
        yield
        cursor.execute(f"PRAGMA cache_size = {usual}")


def _count_on() -> None:
    """Set PostgreSQL's sequence of record numbers to the highest written number."""
    number = "pg_get_serial_sequence('audit_record', 'id')"
    with connection.cursor() as cursor:
        cursor.execute(f"SELECT setval({number}, MAX(id)) FROM audit_record")  # noqa: S608


def settle() -> None:
    """Run PostgreSQL's maintenance now, which it would run later itself: statistics and row visibility."""
    if connection.vendor == "postgresql":
        with connection.cursor() as cursor:
            cursor.execute("VACUUM ANALYZE audit_record, audit_content, teleop_controlsession")
