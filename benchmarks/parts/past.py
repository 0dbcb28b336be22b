"""Years of a lab that never was: valid records, chained as `fleet.audit` chains them, written many at a time.

Some robots are busy and some are not, and so are people; what is rare in a lab is rare here.
"""

from __future__ import annotations

import datetime
import random
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Any, NamedTuple
from uuid import UUID

from django.db import connection, transaction
from django.db.models import Model

from fleet.audit.canonical import NO_ROBOT, content_digest, first_digest, next_digest, plain
from fleet.audit.models import Actor, Chain, Content, Record

AT_ONCE = 5000  # records in one transaction
BEGAN = datetime.datetime(2023, 11, 1, 8, tzinfo=datetime.timezone.utc)
ROBOTS = [f"TIAGo {number}" for number in range(1, 7)]
ROBOT_WEIGHTS = [50, 20, 15, 10, 4.9, 0.1]
PEOPLE = 300
PEOPLE_WEIGHTS = [1 / number for number in range(1, PEOPLE + 1)]
RARE_WORD = "zanzibar"
RARE_OUTCOME = "link_lost"
SAID_WORDS = [
    *("hello", "welcome", "please", "follow", "thank", "you", "the", "laboratory", "good", "morning"),
    *("mañana", "buenos", "días", "你好", "欢迎", "机器人", "实验室", "مرحبا", "روبوت", "شكرا"),
    *(f"word{number}" for number in range(400)),
]
MOTIONS = ["wave", "head_tour", "home", "offer", "bow"]


class Event(NamedTuple):
    """A record to be, before it has its place."""

    kind: str
    of: int | None = None  # how many records earlier of the same scene
    outcome: str = ""
    parameters: dict[str, Any] = {}
    text: str = ""
    private: dict[str, Any] = {}
    robot: bool = True
    person: bool = True


class Past:
    """The log of a new database, which may grow."""

    def __init__(self, seed: int = 1) -> None:
        chance = random.Random(seed)  # noqa: S311  # a lab, not a secret
        self.robots = {UUID(int=chance.getrandbits(128)): name for name in ROBOTS}
        self.people = {
            str(UUID(int=chance.getrandbits(128))): f"Person {number:03}" for number in range(PEOPLE)
        }
        Chain.objects.bulk_create([Chain(id=key, name=name) for key, name in self.robots.items()])
        Chain.objects.get_or_create(id=NO_ROBOT)
        Actor.objects.bulk_create([Actor(id=key, name=name) for key, name in self.people.items()])
        self._count = Record.objects.count()
        self._chains = _Chains()
        self._records = _records(chance, self.robots, list(self.people), self._chains)

    def grow(self, count: int) -> None:
        """Until there are so many records of this lab, beside what others have recorded meanwhile."""
        self._chains.look()
        while self._count < count:
            batch = list(islice(self._records, min(AT_ONCE, count - self._count)))
            with transaction.atomic():
                _insert(Record, [record for record, _content in batch])
                _insert(Content, [content for _record, content in batch if content])
            self._count += len(batch)
        if connection.vendor == "postgresql":
            number = "pg_get_serial_sequence('audit_record', 'id')"
            with connection.cursor() as cursor:
                cursor.execute(f"SELECT setval({number}, MAX(id)) FROM audit_record")  # noqa: S608
                cursor.execute(
                    "VACUUM ANALYZE audit_record, audit_content"
                )  # as the server does by itself later


def _insert(model: type[Model], objects: Sequence[Model]) -> None:
    """Faster than `bulk_create`, which on SQLite makes a statement of every few dozen rows."""
    fields = model._meta.concrete_fields
    columns = ", ".join(connection.ops.quote_name(str(field.column)) for field in fields)
    values = ", ".join(["%s"] * len(fields))
    rows = [
        [field.get_db_prep_save(getattr(row, field.attname), connection) for field in fields]
        for row in objects
    ]
    with connection.cursor() as cursor:
        cursor.executemany(f"INSERT INTO {model._meta.db_table} ({columns}) VALUES ({values})", rows)  # noqa: S608


class _Chains:
    """The head of each chain, and the next number over all."""

    def look(self) -> None:
        """Go on from what is there."""
        self._number = Record.objects.order_by("-pk").values_list("pk", flat=True).first() or 0
        self._heads: dict[UUID, tuple[int, str]] = {}

    def append(self, record: Record) -> None:
        """Give the record its place."""
        chain = record.robot_id or NO_ROBOT
        if chain not in self._heads:
            last = (
                Record.objects.filter(robot_id=record.robot_id)
                .order_by("-seq")
                .values_list("seq", "digest")
                .first()
            )
            self._heads[chain] = last or (0, first_digest(chain))
        seq, digest = self._heads[chain]
        self._number += 1
        record.id, record.seq = self._number, seq + 1
        record.digest = next_digest(digest, record)
        self._heads[chain] = record.seq, record.digest


def _records(
    chance: random.Random, robots: dict[UUID, str], people: list[str], chains: _Chains
) -> Iterator[tuple[Record, Content | None]]:
    at = BEGAN
    while True:
        at += datetime.timedelta(seconds=chance.expovariate(1 / 250))
        [robot] = chance.choices(list(robots), ROBOT_WEIGHTS)
        [person] = chance.choices(people, PEOPLE_WEIGHTS)
        session, scene = UUID(int=chance.getrandbits(128)), list[Record]()
        for event in _scene(chance):
            at += datetime.timedelta(seconds=chance.expovariate(1 / 5))
            of = scene[-event.of] if event.of else None
            record = Record(
                at=at,
                day=at.date(),
                kind=event.kind,
                actor_id=person if event.person else None,
                robot_id=robot if event.robot else None,
                robot_name=robots[robot] if event.robot else "",
                session_id=session if event.robot else None,
                fence=len(scene) if event.robot else None,
                request_id=of.request_id if of else UUID(int=chance.getrandbits(128)),
                of_id=of.pk if of else None,
                outcome=event.outcome,
                parameters=plain(event.parameters),
            )
            content = None
            if event.text or event.private:
                content = Content(
                    record=record,
                    text=event.text,
                    data=plain(event.private),
                    salt=f"{chance.getrandbits(128):032x}",
                )
                record.content_digest = content_digest(content.salt, content.text, content.data)
            chains.append(record)
            if content:
                content.record_id = record.pk
            scene.append(record)
            yield record, content


def _scene(chance: random.Random) -> list[Event]:
    """What belongs together: a drive with its interventions, a text with its end."""
    [what] = chance.choices(
        ["speech", "drive", "motion", "control", "refusal", "sign_in", "robot"], [35, 25, 15, 10, 7, 5, 3]
    )
    match what:
        case "speech":
            return _speech(chance)
        case "drive":
            return _drive(chance)
        case "motion":
            start = Event("motion.start", parameters={"motion": chance.choice(MOTIONS)})
            return [start, Event("motion.end", 1, _outcome(chance), {"duration_s": 4.5})]
        case "control":
            return [Event("control.take", parameters={"seconds": 900}), Event("control.release")]
        case "refusal":
            [code] = chance.choices(
                ["role_too_low", "not_allowed", "not_holder", "stale"], [40, 30, 29.9, 0.1]
            )
            words = {"words": "Not done: ask the staff."}
            return [Event("refusal", outcome=code, parameters={"rule": "lease"}, private=words)]
        case "sign_in":
            return [
                Event("account.sign_in", private={"address": "10.0.0.7", "browser": "Firefox"}, robot=False)
            ]
    return [Event("robot.change", private={"changes": [{"field": "enabled", "from": True, "to": False}]})]


def _speech(chance: random.Random) -> list[Event]:
    words = chance.choices(SAID_WORDS, k=chance.randint(3, 10))
    if chance.random() < 0.00005:
        words.append(RARE_WORD)
    start = Event("speech.start", parameters={"language": "en-GB", "topic": "/tts"}, text=" ".join(words))
    return [start, Event("speech.end", 1, _outcome(chance), {"progress": 1})]


def _drive(chance: random.Random) -> list[Event]:
    events = [Event("drive.start")]
    for _ in range(chance.choice([0, 0, 1, 1, 2, 4])):
        [code] = chance.choices(["obstacle", "braking", "tight", "stale_scan"], [70, 25, 4, 1])
        figures = {"sensor": "laser", "distance_m": round(chance.uniform(0.2, 1.5), 3), "side": "front"}
        events += [
            Event("gate.begin", len(events), code, figures),
            Event("gate.end", 1, parameters={"duration_s": round(chance.uniform(0.1, 3.0), 2)}),
        ]
    [ended_by] = chance.choices(["standstill", "control changed", RARE_OUTCOME], [97, 2.9, 0.1])
    figures = {
        "distance_m": round(chance.uniform(0.1, 20.0), 3),
        "duration_s": round(chance.uniform(1, 60), 2),
    }
    path = [[round(chance.uniform(-5, 5), 2) for _ in range(3)] for _ in range(20)]
    return [*events, Event("drive.end", len(events), ended_by, figures, private={"path": path})]


def _outcome(chance: random.Random) -> str:
    [outcome] = chance.choices(["succeeded", "cancelled", "failed"], [95, 4, 1])
    return str(outcome)
