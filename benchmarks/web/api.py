"""The API: reads, speech, the stream of a token beside the page's, and driving beside 100 reads a second and an export.

Load and driving share the machine. During the export, driver and observer have real-time priority, because in
reality they would be on other computers.
"""

from __future__ import annotations

import asyncio
import time

from benchmarks.driving.drive import BARE_STICKS, ROBOT, drive
from benchmarks.harness import Figure, progress, quantile
from benchmarks.parts.api_programs import READS_PER_S, Client, running
from benchmarks.parts.observer import Observer
from benchmarks.parts.priority import prefer_loops_or_say, prefer_witness
from benchmarks.parts.viewer_crowd import Crowd
from script.stack.client import Driver, sign_in
from script.stack.stack import Stack, temporary_stack
from tests.script.support import manage
from tests.script.support import token as token_of

OTHER = BARE_STICKS[1].slug  # speaks
READS = 200
TEXTS = 20
VIEWERS = 10
SCOPES = ("read", "drive", "speak")
TURNS = 4  # with the page's session, and as many with the token
ALONE_S = 15.0
PATHS = ("/robots", f"/robots/{ROBOT}", f"/robots/{ROBOT}/phrases", f"/robots/{OTHER}/speech/history")

RECORDS = 20_000  # in the log that is exported again and again
_FILL = f"""
from django.db import transaction
from fleet.accounts.models import User
from fleet.audit.services import record
from robots.registry.models import Robot
person, robot = User.objects.get(username="operator"), Robot.objects.get(slug="{OTHER}")
facts = {{"robot_id": robot.id, "robot_name": robot.name, "parameters": {{"language": "en-GB", "topic": "/tts"}}}}
for _ in range({RECORDS // 1000}):
    with transaction.atomic():
        for number in range(1000):
            record("speech.start", actor=person, text=f"Number {{number}}.", **facts)
"""

READ_P50_MS = 15.0
SPEECH_P50_MS = 25.0
MIXED_P95_MS = 100.0
COMMAND_P99_MS = 10.0
TOKEN_TIMES = 1.2


def measure() -> list[Figure]:
    """Start a console with two robots, and use it as programs do."""
    with temporary_stack(BARE_STICKS[:2]) as stack:
        return asyncio.run(_measure_on(stack))


async def _measure_on(stack: Stack) -> list[Figure]:
    token = await asyncio.to_thread(token_of, stack, "operator", *SCOPES)
    figures = await asyncio.to_thread(_alone, stack, token)
    page = await asyncio.to_thread(sign_in, stack, "operator")
    async with Observer(stack.robots[ROBOT]) as observer:
        progress("the streams of page and token, in turn ...")
        by_page: list[float] = []
        by_token: list[float] = []
        for _ in range(TURNS):
            by_page += await _stream(stack, page, observer)
            by_token += await _stream(stack, f"Bearer {token}", observer)
        progress("reads alone ...")
        with running(stack, token, PATHS) as unhindered:
            await asyncio.sleep(ALONE_S)
        progress("driving beside reads and viewers ...")
        watching = await asyncio.to_thread(sign_in, stack, "observer")
        auditor = await asyncio.to_thread(token_of, stack, "staff", *SCOPES)
        await asyncio.to_thread(_fill_log, stack)
        async with Crowd(stack, ROBOT, watching, VIEWERS), Driver(stack, ROBOT, f"Bearer {token}") as driver:
            await driver.take()
            with running(stack, token, PATHS) as alone:
                for _ in range(TURNS):
                    await drive(driver, observer)
            prefer_witness(observer.pid)
            with running(stack, token, PATHS, auditor) as spent:
                ordinary = [delay for _ in range(TURNS) for delay in await drive(driver, observer)]
                prefer_loops_or_say(stack)
                beside = [delay for _ in range(TURNS) for delay in await drive(driver, observer)]
            dead_man = sum(one.refusal.code == "dead_man" for one in driver.refused)
    return [
        *figures,
        Figure("page's stream: command p50", 1000.0 * quantile(by_page, 0.5), "ms"),
        Figure("token's stream: command p50", 1000.0 * quantile(by_token, 0.5), "ms"),
        Figure(
            "token's stream / page's: p50",
            quantile(by_token, 0.5) / quantile(by_page, 0.5),
            "times",
            TOKEN_TIMES,
        ),
        Figure(
            f"{READS_PER_S:.0f} mixed reads a second: p95",
            quantile(unhindered.reads_ms, 0.95),
            "ms",
            MIXED_P95_MS,
        ),
        Figure(
            "the same beside ten viewers and a driver: p95",
            quantile(alone.reads_ms, 0.95),
            "ms",
            MIXED_P95_MS,
        ),
        Figure("the same beside an export, too: p95", quantile(spent.reads_ms, 0.95), "ms", MIXED_P95_MS),
        Figure("reads a second beside it", len(spent.reads_ms) / spent.seconds, ""),
        Figure("records exported a second meanwhile", spent.exported / spent.seconds, ""),
        Figure("beside them: command p99, ordinary priority", 1000.0 * quantile(ordinary, 0.99), "ms"),
        Figure("beside them: command p99", 1000.0 * quantile(beside, 0.99), "ms", COMMAND_P99_MS),
        Figure("beside them: dead-man", float(dead_man), "", 0.0),
    ]


def _fill_log(stack: Stack) -> None:
    """Write `RECORDS` requests to the log, for the export."""
    progress(f"writing {RECORDS:,} records ...")
    manage(stack, "shell", "--no-imports", "-c", _FILL)


def _alone(stack: Stack, token: str) -> list[Figure]:
    progress("reads and speech alone ...")
    client = Client(stack.port, token)
    reads = [client.ask("GET", f"/robots/{ROBOT}") for _ in range(READS)]
    client.ask("POST", f"/robots/{OTHER}/control", {})
    spoken = []
    for number in range(TEXTS):
        text = {"text": f"Number {number}.", "language": "en-GB"}
        spoken.append(client.ask("POST", f"/robots/{OTHER}/speech", text))
        client.ask("DELETE", f"/robots/{OTHER}/speech")
        time.sleep(0.3)
    client.ask("DELETE", f"/robots/{OTHER}/control")
    return [
        Figure("GET robot: p50", quantile(reads, 0.5), "ms", READ_P50_MS),
        Figure(
            "POST speech, answered when the goal is sent: p50", quantile(spoken, 0.5), "ms", SPEECH_P50_MS
        ),
    ]


async def _stream(stack: Stack, signed_in: str, observer: Observer) -> list[float]:
    async with Driver(stack, ROBOT, signed_in) as driver:
        await driver.take()
        delays = await drive(driver, observer)
        await driver.release()
    return delays
