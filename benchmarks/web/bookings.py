"""Bookings on SQLite and PostgreSQL: fifty people after one slot, a week of ten robots, control's rules, driving."""

from __future__ import annotations

import asyncio
import http.client
import json
import re
import threading
import time
import urllib.parse
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

from benchmarks.driving.drive import BARE_STICKS, drive
from benchmarks.harness import Figure, progress, quantile
from benchmarks.parts.observer import Observer
from benchmarks.web.class_signs_in import class_signs_in, stop_s
from script.stack.client import Driver, sign_in
from script.stack.stack import Stack, temporary_stack
from tests.script.servers import postgresql
from tests.script.support import manage

ROWS = 100_000
CLIENTS = 50
RACES = 5
READS = 60
FEED_P95_MS = 100.0
RACE_P95_MS = 500.0
RULES_MS = 5.0
STUDENTS = 500
ENROL_S = 5.0
PASSWORD = "a password of the whole class"  # noqa: S105 - of invented people
SIGN_IN_S = 10.0
STOP_MS = 200.0
LINE = 40
LINE_P95_MS = 2000.0  # a join costs 25 ms of a core, forty at the same instant a second
CALLED_S = 3.0
TURNS = 4  # of driving with bookings, and as many without
DRIVING_TIMES = 1.1  # bookings should add no delay; the margin is for the noise between turns


def measure() -> list[Figure]:
    """Measure both databases, each behind a real web process."""
    figures = []
    for name, database in (("SQLite", _sqlite), ("PostgreSQL", postgresql)):
        with database() as url:
            settings = {"FLEET_DATABASE_URL": url} if url else {}
            with temporary_stack((), settings=settings) as stack:
                figures += _measure_on(stack, name)
    progress("driving with bookings and without, in turn ...")
    with temporary_stack(BARE_STICKS[:1]) as stack:
        return figures + asyncio.run(_driving(stack))


@contextmanager
def _sqlite() -> Iterator[str]:
    yield ""


def _measure_on(stack: Stack, name: str) -> list[Figure]:
    progress(f"{name}: {ROWS} bookings ...")
    rules = json.loads(_stored(stack, f"main({ROWS})"))
    cookie = sign_in(stack, "operator")
    progress(f"{name}: the calendar's week ...")
    monday = datetime.now(UTC).date()
    address = f"/bookings/feed/?start={monday}&end={monday + timedelta(days=7)}"
    reads = [_ask(stack, cookie, "GET", address) for _ in range(READS)]
    events = len(json.loads(reads[0].body)["events"])
    progress(f"{name}: {CLIENTS} clients after one slot, {RACES} times ...")
    races = [_race(stack, cookie, number) for number in range(RACES)]
    progress(f"{name}: a course of {STUDENTS} people ...")
    enrolled_s = _enrol(stack)
    progress(f"{name}: a class of {CLIENTS} signs in ...")
    _stored(stack, f"students({CLIENTS}, {PASSWORD!r})")
    staff = sign_in(stack, "staff")
    quiet_s = [stop_s(stack, staff) for _ in range(20)]
    signed = class_signs_in(stack, CLIENTS, PASSWORD, staff)
    progress(f"{name}: a line of {LINE} ...")
    line = _line(stack)
    answers = [answer for race in races for answer in race]
    won = sum(answer.status == 200 for answer in answers)
    strange = [answer.status for answer in answers if answer.status not in (200, 409)]
    return [
        Figure(f"{name}: week of 10 robots, {events} events: p95", _p95_ms(reads), "ms", FEED_P95_MS),
        Figure(f"{name}: {CLIENTS} after one slot: answer p95", _p95_ms(answers), "ms", RACE_P95_MS),
        Figure(f"{name}: winners beyond one per slot", float(abs(won - RACES)), "", 0.0),
        Figure(f"{name}: answers that are no refusal", float(len(strange)), "", 0.0),
        Figure(f"{name}: a course with {STUDENTS} new people", enrolled_s, "s", ENROL_S),
        Figure(
            f"{name}: a class of {CLIENTS} signs in: p95", quantile(signed.waited_s, 0.95), "s", SIGN_IN_S
        ),
        Figure(
            f"{name}: people of the class turned away",
            float(sum(status != 302 for status in signed.statuses)),
            "",
            0.0,
        ),
        Figure(f"{name}: a line of {LINE}, all join at once: p95", _p95_ms(line.joined), "ms", LINE_P95_MS),
        Figure(f"{name}: a line of {LINE}: all read it at once: p95", _p95_ms(line.read), "ms", LINE_P95_MS),
        Figure(f"{name}: people of the line without a place of their own", float(line.lost), "", 0.0),
        Figure(f"{name}: until the first of the line is called", line.called_s, "s", CALLED_S),
        Figure(f"{name}: Stop all meanwhile: p95", 1000.0 * quantile(signed.stops_s, 0.95), "ms", STOP_MS),
        Figure(f"{name}: Stop all before: p95", 1000.0 * quantile(quiet_s, 0.95), "ms"),
        Figure(
            f"{name}: added to Take control by bookings: p95",
            rules["with_ms"] - rules["without_ms"],
            "ms",
            RULES_MS,
        ),
    ]


def _stored(stack: Stack, step: str) -> str:
    """Run a step of `booking_rows` in the console's database, and return its output."""
    program = f"from benchmarks.web.booking_rows import *; {step}"
    return manage(stack, "shell", "--no-imports", "-c", program)


async def _driving(stack: Stack) -> list[Figure]:
    """Drive a robot in a booked slot, and without bookings, in turn."""
    [slug] = stack.robots
    cookie = await asyncio.to_thread(sign_in, stack, "operator")
    booked: list[float] = []
    free: list[float] = []
    for _ in range(TURNS):
        for rows, spent in ((ROWS // 10, booked), (0, free)):
            await asyncio.to_thread(_stored, stack, f"fill_one({slug!r}, {rows})")
            async with Observer(stack.robots[slug]) as observer, Driver(stack, slug, cookie) as driver:
                await driver.take()
                spent += await drive(driver, observer)
                await driver.release()
    times = quantile(booked, 0.5) / quantile(free, 0.5)
    return [
        Figure("command in a booked slot: p50", 1000.0 * quantile(booked, 0.5), "ms"),
        Figure("command in a booked slot: p99", 1000.0 * quantile(booked, 0.99), "ms"),
        Figure("command without bookings: p99", 1000.0 * quantile(free, 0.99), "ms"),
        Figure("command with bookings / without: p50", times, "times", DRIVING_TIMES),
    ]


class _Answer(NamedTuple):
    """An answer of the console, and how long it took."""

    status: int
    body: str
    took_ms: float


def _race(stack: Stack, cookie: str, number: int) -> list[_Answer]:
    """Let all clients book the same free slot at once."""
    page = _ask(stack, cookie, "GET", "/bookings/new/?robot=row-0")
    [token] = set(re.findall(r'name="csrfmiddlewaretoken" value="([^"]+)"', page.body))
    starts = datetime.now(UTC) + timedelta(hours=3 + 2 * number)
    times = (f"{at:%Y-%m-%dT%H:%M}" for at in (starts, starts + timedelta(hours=1)))
    fields = dict(zip(("starts_at", "ends_at"), times, strict=True))
    body = urllib.parse.urlencode({"robot": "row-0", "csrfmiddlewaretoken": token, **fields})
    answers: list[_Answer] = []
    ready = threading.Barrier(CLIENTS)

    def client() -> None:
        ready.wait()
        answers.append(_ask(stack, cookie, "POST", "/bookings/new/", body))

    threads = [threading.Thread(target=client) for _ in range(CLIENTS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return answers


class _Line(NamedTuple):
    """Answers of forty people who join a lesson's line at once, then read it at once."""

    joined: list[_Answer]
    read: list[_Answer]
    lost: int  # people without a turn in the line
    called_s: float  # from the last who joined until somebody is called


def _line(stack: Stack) -> _Line:
    made = json.loads(_stored(stack, f"lesson({LINE})"))
    address = f"/api/v1/bookings/{made['booking']}/lesson"
    _at_once(stack, made["tokens"], "GET", address)  # the page that they join from
    joined = _at_once(stack, made["tokens"], "POST", f"{address}/line")
    began_s = time.perf_counter()
    while True:
        line = json.loads(_ask(stack, "", "GET", address, token=made["tokens"][0]).body)["line"]
        if any(turn["state"] == "called" for turn in line):
            break
        time.sleep(0.05)
    called_s = time.perf_counter() - began_s
    read = _at_once(stack, made["tokens"], "GET", address)
    return _Line(joined, read, LINE - len({turn["id"] for turn in line}), called_s)


def _at_once(stack: Stack, tokens: list[str], method: str, path: str) -> list[_Answer]:
    answers: list[_Answer] = []
    ready = threading.Barrier(len(tokens))

    def one(token: str) -> None:
        ready.wait()
        answers.append(_ask(stack, "", method, path, "" if method == "POST" else None, token=token))

    threads = [threading.Thread(target=one, args=(token,)) for token in tokens]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return answers


def _enrol(stack: Stack) -> float:
    """Make a course with new people by the form. Return the seconds that it took after the preview."""
    cookie = sign_in(stack, "staff")
    page = _ask(stack, cookie, "GET", "/courses/new/").body
    today = datetime.now(UTC).date()
    fields = {
        "csrfmiddlewaretoken": re.findall(r'name="csrfmiddlewaretoken" value="([^"]+)"', page)[0],
        "robots": re.findall(r'name="robots" value="([^"]+)"', page)[0],
        "name": "Five hundred",
        "role": "operator",
        "starts_on": str(today),
        "ends_on": str(today + timedelta(days=100)),
        "people": "\n".join(f"Student {number} <student{number}@example.org>" for number in range(STUDENTS)),
    }
    preview = _ask(stack, cookie, "POST", "/courses/new/", urllib.parse.urlencode(fields))
    fields["seen"] = re.findall(r'name="seen" value="([^"]+)"', preview.body)[0]
    made = _ask(stack, cookie, "POST", "/courses/new/", urllib.parse.urlencode(fields))
    if made.status != 302:
        raise AssertionError(f"the course was not made: {made.status} {made.body[:500]}")
    return made.took_ms / 1000.0


def _ask(
    stack: Stack, cookie: str, method: str, path: str, body: str | None = None, *, token: str = ""
) -> _Answer:
    connection = http.client.HTTPConnection("127.0.0.1", stack.port, timeout=60.0)
    headers = {
        "Cookie": cookie,
        "Origin": stack.url,
        "Accept": "text/html" if method == "GET" else "application/json",
    }
    if token:
        headers = {"Authorization": f"Bearer {token}", "Content-Type": "application/json"}
    elif body is not None:
        headers["Content-Type"] = "application/x-www-form-urlencoded"
    began_s = time.perf_counter()
    connection.request(method, path, body, headers)
    answer = connection.getresponse()
    text = answer.read().decode()
    took_ms = 1000.0 * (time.perf_counter() - began_s)
    connection.close()
    return _Answer(answer.status, text, took_ms)


def _p95_ms(answers: list[_Answer]) -> float:
    return quantile([answer.took_ms for answer in answers], 0.95)
