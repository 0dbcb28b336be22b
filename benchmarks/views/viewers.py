"""Watching a robot: delay and cost of its pictures for 1, 10 and 50 viewers, and effect of one that stalls."""

from __future__ import annotations

import asyncio
import bisect
import time
import zlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass

from websockets.asyncio.client import unix_connect

from benchmarks.harness import Figure, progress, quantile
from benchmarks.parts import process_stats
from benchmarks.parts.observer import Observer
from benchmarks.parts.priority import prefer_loops_or_say
from benchmarks.parts.viewer_crowd import Crowd
from robots.shared import wire
from script.stack.client import sign_in
from script.stack.stack import Stack, temporary_stack

ROBOT = "tiago-1"
CROWDS = (1, 10, 50)
MEASURED_S = 20.0
SETTLED_S = 2.0
DELAY_P99_MS = 5.0  # with the largest crowd
CORE_PERCENT = 5.0
BRIDGE_MB = 90.0
WEB_MB = 150.0
OBSERVER_LATE_S = 0.005  # the observer may get a scan later than the bridge
GROWTH_MB = 2.0  # of the web process while one viewer stalls


@dataclass(frozen=True)
class Cost:
    """Processor time used so far, and memory now."""

    web_s: float
    bridge_s: float
    web_mb: float
    bridge_mb: float


def measure() -> list[Figure]:
    """Run three robots; viewers watch one of them."""
    with temporary_stack() as stack:
        return asyncio.run(measure_on(stack))


async def measure_on(stack: Stack) -> list[Figure]:
    """Return all figures."""
    cookie = await asyncio.to_thread(sign_in, stack, "observer")
    bench = Bench(stack, cookie)
    prefer_loops_or_say(stack)
    figures: list[Figure] = []
    async with Observer(stack.robots[ROBOT], "scan") as observer:
        await asyncio.sleep(SETTLED_S)
        idle = await bench.used()
        figures += [
            Figure("nobody looks: web", idle[0], "%"),
            Figure("nobody looks: bridge", idle[1], "%"),
        ]
        for count in CROWDS:
            progress(f"{count} viewers ...")
            figures += await bench.crowd(count, observer)
        progress("one viewer stalls ...")
        figures += await bench.stalled(CROWDS[-1])
    cost = bench.cost()
    return [
        *figures,
        Figure("memory: bridge", cost.bridge_mb, "MB", BRIDGE_MB),
        Figure("memory: web process", cost.web_mb, "MB", WEB_MB),
    ]


class Bench:
    """The processes that are measured."""

    def __init__(self, stack: Stack, cookie: str) -> None:
        self._stack = stack
        self._cookie = cookie
        self.pictures_hz = 0.0  # for each viewer of the last crowd
        slug = stack.robots[ROBOT].plan.slug
        [self._bridge] = [
            child
            for child in process_stats.children(stack.supervisor.pid)
            if process_stats.arguments(child)[-2:] == ["fleet.site.run_bridge", slug]
        ]

    def cost(self) -> Cost:
        """Return processor time and memory of each process now."""
        web = self._stack.web.pid
        return Cost(
            process_stats.cpu_s(web),
            process_stats.cpu_s(self._bridge),
            process_stats.resident_mb(web),
            process_stats.resident_mb(self._bridge),
        )

    async def used(self) -> tuple[float, float]:
        """Return the percent of a core that web process and bridge use."""
        before, began_s = self.cost(), time.monotonic()
        await asyncio.sleep(MEASURED_S)
        after, seconds = self.cost(), time.monotonic() - began_s
        return (
            100.0 * (after.web_s - before.web_s) / seconds,
            100.0 * (after.bridge_s - before.bridge_s) / seconds,
        )

    async def crowd(self, count: int, observer: Observer) -> list[Figure]:
        """Measure delays and cost with `count` viewers."""
        largest = count == CROWDS[-1]
        async with Crowd(self._stack, ROBOT, self._cookie, count) as crowd, self._link() as drawn:
            await asyncio.sleep(SETTLED_S)
            observer.forget()
            drawn.clear()
            crowd.seen.clear()
            web, bridge = await self.used()
        shown = [
            (drawn[checksum], at_s)
            for checksum, arrivals in crowd.seen.items()
            if checksum in drawn
            for at_s in arrivals.values()
        ]
        fan_out_ms = [1000.0 * (at_s - drawn_s) for drawn_s, at_s in shown]
        from_scan_ms = [
            1000.0 * (at_s - scan_s)
            for drawn_s, at_s in shown
            if (scan_s := latest(observer.scans, drawn_s + OBSERVER_LATE_S))
        ]
        self.pictures_hz = len(shown) / count / MEASURED_S
        name = f"{count} viewer{'s' if count > 1 else ''}"
        return [
            Figure(f"{name}: scan -> viewer p50", quantile(from_scan_ms, 0.50), "ms"),
            Figure(
                f"{name}: scan -> viewer p99",
                quantile(from_scan_ms, 0.99),
                "ms",
                DELAY_P99_MS if largest else None,
            ),
            Figure(f"{name}: bridge -> viewer p50", quantile(fan_out_ms, 0.50), "ms"),
            Figure(f"{name}: bridge -> viewer p99", quantile(fan_out_ms, 0.99), "ms"),
            Figure(f"{name}: pictures each", self.pictures_hz, "/s"),
            Figure(f"{name}: web", web, "%", CORE_PERCENT if largest else None),
            Figure(f"{name}: bridge", bridge, "%", CORE_PERCENT if largest else None),
        ]

    async def stalled(self, count: int) -> list[Figure]:
        """Let one viewer stop reading.

        Measure whether the others still get all pictures, and the growth of memory.
        """
        crowd = Crowd(self._stack, ROBOT, self._cookie, count, one_stalls=True)
        async with crowd:
            await asyncio.sleep(SETTLED_S)
            crowd.seen.clear()
            before = self.cost()
            await asyncio.sleep(MEASURED_S)
            after = self.cost()
            pictures = sum(len(arrivals) for arrivals in crowd.seen.values())
        pictures_hz = pictures / (count - 1) / MEASURED_S
        return [
            Figure(
                "one stalls: others get fewer pictures",
                100.0 * (1.0 - pictures_hz / self.pictures_hz),
                "%",
                2.0,
            ),
            Figure("one stalls: web process grows", after.web_mb - before.web_mb, "MB", GROWTH_MB),
        ]

    @asynccontextmanager
    async def _link(self) -> AsyncIterator[dict[int, float]]:
        """Context: record when each picture was drawn, on a second link to the bridge."""
        drawn: dict[int, float] = {}
        path = self._stack.robots[ROBOT].link_path
        async with unix_connect(path, compression=None, ping_interval=None) as link:
            await link.send(wire.encode(wire.LinkHello(wire.PROTOCOL, "benchmark")), text=True)
            # The same name as the viewers, so that the list of watchers, and with it the picture, does not
            # change.
            await link.send(
                wire.encode(wire.Viewers([self._stack.accounts["observer"].username.capitalize()])),
                text=True,
            )

            async def read() -> None:
                async for raw in link:
                    if isinstance(raw, bytes):
                        drawn[zlib.crc32(raw)] = time.monotonic()

            reading = asyncio.create_task(read())
            try:
                yield drawn
            finally:
                reading.cancel()
                with suppress(asyncio.CancelledError):
                    await reading


def latest(times: list[float], until_s: float) -> float | None:
    """Return the last of these ascending times that is not after `until_s`; None: there is none."""
    index = bisect.bisect_right(times, until_s)
    return times[index - 1] if index else None
