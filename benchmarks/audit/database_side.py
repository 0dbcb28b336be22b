"""The audit log's side of a benchmark: a process with its own database. It prints measurements as JSON.

reading COUNT...   open pages and verify the log at each number of records; export it at the last number
writing SECONDS    after the end of stdin, write requests with their outcomes for SECONDS
"""

from __future__ import annotations

import asyncio
import json
import resource
import sys
import time
import uuid
from collections.abc import AsyncIterator, Iterator
from contextlib import suppress
from datetime import datetime, timedelta
from itertools import product
from statistics import median
from typing import Any, cast
from unittest.mock import patch
from urllib.parse import urlencode
from uuid import UUID

from asgiref.sync import sync_to_async
from django.conf import settings
from django.db import connection
from django.db.models import Count
from django.test import Client
from django.urls import reverse

from benchmarks.audit import history_writer, invented_lab
from fleet.accounts.models import User
from fleet.audit.errors import AuditUnavailable
from fleet.audit.integrity.verify import verify_all
from fleet.audit.models import Record
from fleet.audit.reading import exports
from fleet.audit.reading.listing import CONSOLE, Selection, Wanted
from fleet.audit.services import record
from robots.registry.models import Robot
from teleop.models import ControlSession
from teleop.reports import views
from teleop.reports.robot_report import PERIODS_DAYS

FAST_MS = 100.0  # a page that is at most this slow is not measured again
TIMES = 5  # measurements of each slower page; the first opening does not count
MARKS = (b"audit-bar", b'data-page="robot-report"')  # text by which a list and a report are recognised
# Some kinds and outcomes of each list, frequent ones before rare ones.
FILTERS = {
    "speechrecord": ([], ["done", "failed"]),
    "motionrecord": (["drive.start", "motion.start"], ["standstill", invented_lab.RARE_OUTCOME]),
    "refusalrecord": (["gate.begin", "refusal"], ["obstacle", invented_lab.RARE_REFUSAL]),
    "record": (["speech.start", "robot.change", "fault"], ["done", invented_lab.RARE_OUTCOME]),
    "controlsession": ([], ["released", "right"]),
}
WORDS = (
    *("the", "word12", "实验室", "the zanzibar", invented_lab.RARE_WORD, "never said"),
    *("lo", "qq", "你", "the lo"),
)

Asked = dict[str, Any]


def reading(counts: list[int]) -> None:
    """Let the log grow to each count, and measure it there."""
    grown = history_writer.Past()
    for count in counts:
        began_s = time.monotonic()
        grown.grow(count)
        history_writer.settle()
        _say(count=count, filled_s=round(time.monotonic() - began_s, 1))
        for name, query, ms in pages(grown.newest, 2 if count == max(counts) else 6):
            _say(count=count, page=name, query=query, ms=round(ms, 1))
        began_s = time.monotonic()
        findings = verify_all().findings
        _say(count=count, verified_s=round(time.monotonic() - began_s, 2), findings=len(findings))
    asyncio.run(_export(counts[-1]))


def writing(seconds: float) -> None:
    """Commit records in one process. On SQLite, a writer that does not get the lock tries the next record."""
    robot_id = uuid.uuid4()
    connection.ensure_connection()
    sys.stdin.read()
    count, began_s = 0, time.monotonic()
    while time.monotonic() - began_s < seconds:
        with suppress(AuditUnavailable):
            start = record("speech.start", robot_id=robot_id, robot_name="TIAGo", text="Good morning")
            record("speech.end", of=start, outcome="done", parameters={"duration_s": 1.5})
            count += 2
    _say(per_s=round(count / (time.monotonic() - began_s), 1))


def pages(newest: datetime, each: int) -> Iterator[tuple[str, str, float]]:
    """Open complete pages of staff as a browser does; yield the page, its filters and its time in ms.

    Tries one of `each` filters. Fast pages are opened once, after a first page of their kind; slow ones several
    times, and the median counts.
    """
    client = Client()
    client.force_login(_staff())
    for name, address, queries in _addresses(newest):
        _opened(client, address)
        for query in queries[::each] if len(queries) > each else queries:
            times_ms = [_opened(client, f"{address}?{query}")]
            if times_ms[0] > FAST_MS:
                times_ms = [_opened(client, f"{address}?{query}") for _ in range(TIMES)]
            yield name, query, median(times_ms)


def _opened(client: Client, address: str) -> float:
    """Return the time of a page, in ms."""
    began_s = time.perf_counter()
    response = client.get(address)
    took_ms = 1000.0 * (time.perf_counter() - began_s)
    if response.status_code != 200 or not any(mark in response.content for mark in MARKS):
        raise RuntimeError(f"{address}: not what it should be, but {response.status_code}")
    return took_ms


def _addresses(newest: datetime) -> Iterator[tuple[str, str, list[str]]]:
    """Yield each page with its queries, on the day of the newest record."""
    for name in FILTERS:
        app = "teleop" if name == "controlsession" else "audit"
        yield name, reverse(f"admin:{app}_{name}_changelist"), [*_queries(name)]
    with patch.object(views, "now", lambda: newest):
        for robot in Robot.objects.filter(pk__in=_robots()):
            periods = [f"days={days}" for days in PERIODS_DAYS]
            yield "report", reverse("robot-report", args=[robot.slug]), periods


def _queries(name: str) -> Iterator[str]:
    """Yield queries with one or more filters, common and rare, at each position; then queries with words."""
    places, filters = [*_places(name)], [*_filters(name)]
    yield from (urlencode(place | filter_) for filter_ in filters for place in places)
    if name in ("speechrecord", "record"):
        (busy, idle), (often, seldom) = _robots(), _people()
        narrowed: list[Asked] = [
            *({}, {"person": seldom}, {"robot": busy}, {"robot": idle, "person": often}),
            {"robot": busy, "person": often, "outcome": "done"},
        ]
        for words, filter_, place in product(WORDS, narrowed, places):
            yield urlencode({"q": words} | filter_ | place)


def _places(name: str) -> Iterator[Asked]:
    """Yield positions: first page, middle, last page from either end; a day, a month, all before a day."""
    last = Record.objects.order_by("-pk").values_list("pk", flat=True)[0]
    middle = Record.objects.filter(pk__gte=last // 2).order_by("pk")[0]
    if name == "controlsession":  # its pages are divided by time
        keys = [
            int(at.timestamp() * 1e6)
            for at in (middle.at, history_writer.BEGAN + timedelta(days=3), history_writer.BEGAN)
        ]
    else:
        keys = [middle.pk, 100, 0]
    yield from ({}, {"before": keys[0]}, {"before": keys[1]}, {"after": keys[2]})
    yield {"since": middle.day, "until": middle.day}
    yield {"since": middle.day, "until": middle.day + timedelta(days=30)}
    yield {"until": middle.day}


def _filters(name: str) -> Iterator[Asked]:
    """Yield filters by robot, person, kind and outcome: no filter, each filter, and several together."""
    kinds, outcomes = FILTERS[name]
    people: list[Any] = [*_people(), *([] if name == "controlsession" else [CONSOLE])]
    asked: dict[str, list[Any]] = {
        "robot": [*_robots()],
        "person": people,
        "kind": kinds,
        "outcome": outcomes,
    }
    for values in product(*([None, *values] for values in asked.values())):
        yield {filter_: value for filter_, value in zip(asked, values, strict=True) if value}


def _robots() -> tuple[UUID, UUID]:
    """Return the robot with the most control sessions, and the robot with the fewest."""
    return _most_and_least("robot")


def _people() -> tuple[UUID, UUID]:
    return _most_and_least("user")


def _most_and_least(of: str) -> tuple[UUID, UUID]:
    counted = ControlSession.objects.order_by().values_list(of).annotate(times=Count("pk"))
    found = [which for which, _times in counted.order_by("-times", of)]
    return found[0], found[-1]


async def _export(count: int) -> None:
    """Export all records, and print time, size and memory."""
    content = exports.records(Selection(Wanted()), exports.Format.CSV)
    staff = await sync_to_async(_staff)()
    response = await sync_to_async(exports.response)(content, Wanted(), actor=staff, name="all")
    before_kb, began_s, size = _memory_kb(), time.monotonic(), 0
    async for piece in cast(AsyncIterator[bytes], response.streaming_content):
        size += len(piece)
    seconds = time.monotonic() - began_s
    _say(
        count=count,
        exported_s=round(seconds, 1),
        mb=round(size / 1e6, 1),
        grown_mb=(_memory_kb() - before_kb) / 1e3,
    )


def _staff() -> User:
    return User.objects.get_or_create(username="bench", defaults={"is_staff": True})[0]


def _memory_kb() -> int:
    """Return this process's maximum resident memory so far, in KiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _say(**measured: object) -> None:
    sys.stdout.write(json.dumps(measured) + "\n")
    sys.stdout.flush()


def main() -> None:
    """Run the role of the first argument; Django must be set up."""
    # DEBUG keeps every query in memory; it was on because the static files are not collected
    settings.DEBUG = False
    if sys.argv[1] == "reading":
        reading([int(count) for count in sys.argv[2:]])
    else:
        writing(float(sys.argv[2]))
