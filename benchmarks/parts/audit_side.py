"""The audit log's side of a benchmark: a process on a database of its own, which says what it measured in JSON.

reading COUNT...   pages of lists and a verification with so many records each, an export with the last
writing SECONDS    begins when stdin ends: requests with their outcomes, for so long
"""

from __future__ import annotations

import asyncio
import json
import resource
import sys
import time
import uuid
from collections.abc import AsyncIterator, Iterator
from statistics import median
from typing import Any, cast
from urllib.parse import urlencode

from asgiref.sync import sync_to_async
from django.conf import settings
from django.db import connection
from django.test import Client
from django.urls import reverse

from benchmarks.parts import past
from fleet.accounts.models import User
from fleet.audit import exports, record
from fleet.audit.listing import Selection, Wanted
from fleet.audit.models import Record
from fleet.audit.verify import verify_all

TIMES = 5  # each page, after once that is not counted
LISTS = ("speechrecord", "motionrecord", "refusalrecord", "record")


def reading(counts: list[int]) -> None:
    """Grow the log from count to count."""
    lab = past.Past()
    for count in counts:
        lab.grow(count)
        for name, query, times_ms in _pages(lab):
            _say(count=count, page=name, query=query, ms=round(median(times_ms), 1))
        began_s = time.monotonic()
        findings = verify_all().findings
        _say(count=count, verified_s=round(time.monotonic() - began_s, 2), findings=len(findings))
    asyncio.run(_export(counts[-1]))


def writing(seconds: float) -> None:
    """What one process commits."""
    robot_id = uuid.uuid4()
    connection.ensure_connection()
    sys.stdin.read()
    count, began_s = 0, time.monotonic()
    while time.monotonic() - began_s < seconds:
        start = record("speech.start", robot_id=robot_id, robot_name="TIAGo", text="Good morning")
        record("speech.end", of=start, outcome="succeeded", parameters={"progress": 1})
        count += 2
    _say(per_s=round(count / (time.monotonic() - began_s), 1))


def _pages(lab: past.Past) -> Iterator[tuple[str, str, list[float]]]:
    """The pages that staff open, whole, as the browser gets them: which, with what filters, how long in ms."""
    client = Client()
    client.force_login(_staff())
    for name in LISTS:
        address = reverse(f"admin:audit_{name}_changelist")
        for query in _queries(name, lab):
            times_ms = []
            for _ in range(1 + TIMES):
                began_s = time.perf_counter()
                response = client.get(f"{address}?{query}")
                times_ms.append(1000.0 * (time.perf_counter() - began_s))
                if response.status_code != 200 or b"audit-count" not in response.content:
                    raise RuntimeError(f"{address}?{query}: no list")
            yield name, query, times_ms[1:]


def _queries(name: str, lab: past.Past) -> Iterator[str]:
    """First and far pages, common and rare filters, alone and together."""
    busy, rare = next(iter(lab.robots)), list(lab.robots)[-1]
    often, seldom = next(iter(lab.people)), list(lab.people)[-1]
    middle = Record.objects.order_by("-pk").values_list("pk", flat=True)[0] // 2
    day = Record.objects.get(pk=middle).day
    outcomes = {
        "speechrecord": ("succeeded", "failed"),
        "motionrecord": ("standstill", past.RARE_OUTCOME),
        "refusalrecord": ("obstacle", "stale"),
        "record": ("succeeded", past.RARE_OUTCOME),
    }[name]
    places: list[dict[str, Any]] = [{}, {"before": middle}, {"since": day, "until": day}]
    yield from (urlencode(place) for place in [*places, {"until": day, "person": often}])
    for robot in (busy, rare):
        yield urlencode({"robot": robot})
        for person in (often, seldom):
            yield urlencode({"robot": robot, "person": person})
            yield from (
                urlencode({"robot": robot, "person": person, "outcome": outcome}) for outcome in outcomes
            )
    yield from (urlencode({"outcome": outcome, "robot": rare}) for outcome in outcomes)
    if name in ("speechrecord", "record"):
        for words in (
            "the",
            "word12",
            "实验室",
            "the zanzibar",
            past.RARE_WORD,
            "never said",
            "lo",
            "qq",
            "你",
        ):
            yield urlencode({"q": words})
            yield urlencode({"q": words, "before": middle})
            yield urlencode({"q": words, "person": seldom})
            yield urlencode({"q": words, "robot": rare, "person": often})


async def _export(count: int) -> None:
    """Everything, read to its end: how fast, and how much memory it takes."""
    response = await sync_to_async(exports.response)(
        Selection(Wanted()),
        Wanted(),
        actor=await sync_to_async(_staff)(),
        name="all",
        format_=exports.Format.CSV,
    )
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
    """The most that this process has had so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _say(**told: object) -> None:
    sys.stdout.write(json.dumps(told) + "\n")
    sys.stdout.flush()


def main() -> None:
    """In a process whose Django is set up."""
    settings.DEBUG = False  # it keeps every query; it was on because nobody has collected the static files
    if sys.argv[1] == "reading":
        reading([int(count) for count in sys.argv[2:]])
    else:
        writing(float(sys.argv[2]))
