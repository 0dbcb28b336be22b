"""Open fleet pages: processor time of the web process, and what they cost a person who pings or drives beside them."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager

from benchmarks.growth.console import SECONDS, Console, console
from benchmarks.harness import Figure, quantile
from benchmarks.parts import process_stats
from robots.shared import wire
from script.stack.client import Driver, open_socket
from script.stack.places import REPOSITORY

ROBOTS, MANY_ROBOTS = 10, 20
PEOPLE = 100
PAGES, MANY_PAGES = 50, 500
SETTLED_S = 5.0
PING_HZ = 20.0
DRIVE_HZ = 30.0
SLOTS = 2  # of driving, with and without pages by turns


def cost() -> Iterator[Figure]:
    """Measure with few and with many pages, then the bytes of a page with many robots."""
    with console(ROBOTS, PEOPLE) as running:
        yield from asyncio.run(_cost(running))
    with console(MANY_ROBOTS, 1) as running:
        yield asyncio.run(_bytes(running))


async def _cost(running: Console) -> list[Figure]:
    async with _pages(running, PAGES):
        web, pings_ms = await _used(running)
    figures = [
        Figure(f"{PAGES} fleet pages: web process", web, "%", 6.0),
        Figure(f"{PAGES} fleet pages: ping p99", quantile(pings_ms, 0.99), "ms", 10.0),
    ]
    alone_ms: list[float] = []
    beside_ms: list[float] = []
    async with Driver(running, "robot-0", running.cookies[0]) as driver:
        await driver.take()
        for _ in range(SLOTS):
            alone_ms += await _driven(running, driver)
            async with _pages(running, PAGES):
                beside_ms += await _driven(running, driver)
    alone, beside = quantile(alone_ms, 0.99), quantile(beside_ms, 0.99)
    async with _pages(running, MANY_PAGES):
        many, many_pings_ms = await _used(running)
    return [
        *figures,
        Figure("stick alone: p99", alone, "ms"),
        Figure(f"stick beside {PAGES} fleet pages: p99, times alone", beside / alone, "", 1.2),
        Figure(f"{MANY_PAGES} fleet pages: web process", many, "%", 30.0),
        Figure(f"{MANY_PAGES} fleet pages: ping p99", quantile(many_pings_ms, 0.99), "ms"),
    ]


async def _bytes(running: Console) -> Figure:
    async with _pages(running, 1) as received:
        before = received()
        await asyncio.sleep(SECONDS)
        rate = (received() - before) / SECONDS / 1000.0
    return Figure(f"fleet page with {MANY_ROBOTS} robots at rest", rate, "kB/s", 3.0)


@asynccontextmanager
async def _pages(running: Console, count: int) -> AsyncIterator[Received]:
    """Context: open fleet pages, after they have settled. Its value returns the bytes that they received so far."""
    words = [running.hosts[0], str(running.port), running.url, str(count)]
    side = await asyncio.create_subprocess_exec(
        *("/usr/bin/setpriv", "--pdeathsig", "KILL"),
        *(sys.executable, "-m", "benchmarks.growth.pages_side", *words),
        cwd=REPOSITORY,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert side.stdin and side.stdout  # noqa: S101 - we asked for pipes
    side.stdin.write(("\t".join(running.cookies) + "\n").encode())
    received = Received()
    reading = asyncio.create_task(received.read(side.stdout))
    try:
        await asyncio.wait_for(received.opened.wait(), 120.0)
        await asyncio.sleep(SETTLED_S)
        yield received
    finally:
        side.kill()
        await side.wait()
        await reading


class Received:
    """The bytes that all pages have received."""

    def __init__(self) -> None:
        self.opened = asyncio.Event()
        self._bytes = 0

    def __call__(self) -> int:
        return self._bytes

    async def read(self, lines: asyncio.StreamReader) -> None:
        """Read until the pages end."""
        async for line in lines:
            if line == b"ready\n":
                self.opened.set()
            else:
                self._bytes = int(line)


async def _used(running: Console) -> tuple[float, list[float]]:
    """Return the percent of a core that the web process uses, and the round trips of pings meanwhile (ms)."""
    pings_ms = []
    async with await open_socket(running, "/ws/fleet/", running.cookies[0]) as socket:
        before, began_s = process_stats.cpu_s(running.web.pid), time.monotonic()
        while time.monotonic() - began_s < SECONDS:
            sent_ms = time.monotonic() * 1000.0
            await socket.send(wire.encode(wire.Ping(sent_ms)), text=True)
            while not (await socket.recv(decode=False)).startswith(b'{"t":"pong"'):
                pass
            pings_ms.append(time.monotonic() * 1000.0 - sent_ms)
            await asyncio.sleep(1.0 / PING_HZ)
        seconds = time.monotonic() - began_s
    return 100.0 * (process_stats.cpu_s(running.web.pid) - before) / seconds, pings_ms


async def _driven(running: Console, driver: Driver) -> list[float]:
    """Send the stick in the middle; return the times until the bridge has each message (ms)."""
    sent_ns: dict[int, int] = {}
    for _ in range(int(SECONDS * DRIVE_HZ)):
        now_ns = time.monotonic_ns()
        sent_ns[(await driver.drive(0.0, 0.0)).seq] = now_ns
        await asyncio.sleep(1.0 / DRIVE_HZ)
    await asyncio.sleep(1.0)
    lines = running.supervisor.log.read_text().splitlines() if running.supervisor.log else []
    arrived = (map(int, line.split()) for line in lines if line[:1].isdigit())
    return [(at_ns - sent_ns[seq]) / 1e6 for seq, at_ns in arrived if seq in sent_ns]
