"""Cost of the audit log for a driver: the same commands through the same bridge, with and without records in turn."""

from __future__ import annotations

import asyncio
import gc
from pathlib import Path
from statistics import median

from benchmarks.driving.drive import BARE_STICKS, ROBOT, drive
from benchmarks.harness import Figure, progress, quantile
from benchmarks.parts.observer import Observer
from script.stack.client import Driver, sign_in
from script.stack.stack import Stack

# Whether records are written; in this order a slow drift has no effect
TURNS = (True, False, False, True) * 10
SAMPLES = 100  # of each turn: many short turns, because the machine's speed changes every few seconds
MOST_TIMES = 1.05
STANDSTILL_S = 1.5  # until a drive has ended


def latency(directory: Path) -> list[Figure]:
    """Start a console with one robot in this directory, and drive it."""
    off = directory / "unrecorded"
    settings = {
        "DJANGO_SETTINGS_MODULE": "benchmarks.audit.switchable_log",
        "FLEET_BENCH_UNRECORDED": str(off),
    }
    with Stack(directory, robots=BARE_STICKS[:1], settings=settings) as stack:
        return asyncio.run(_measured(stack, off))


async def _measured(stack: Stack, off: Path) -> list[Figure]:
    gc.freeze()
    cookie = await asyncio.to_thread(sign_in, stack, "operator")
    delays_s: dict[bool, list[float]] = {True: [], False: []}
    async with Observer(stack.robots[ROBOT]) as observer, Driver(stack, ROBOT, cookie) as driver:
        await driver.take()
        progress("warming up ...")  # after taking control the bridge first reads the robot's map and motions
        await drive(driver, observer, SAMPLES)
        for recorded in TURNS:
            progress("driving, recorded ..." if recorded else "driving, not recorded ...")
            _switch(off, recorded)
            delays_s[recorded] += await drive(driver, observer, SAMPLES)
            await asyncio.sleep(STANDSTILL_S)
    with_log, without = delays_s[True], delays_s[False]
    return [
        Figure("command, recorded p50", 1000.0 * median(with_log), "ms"),
        Figure("command, recorded p99", 1000.0 * quantile(with_log, 0.99), "ms"),
        Figure("command, not recorded p50", 1000.0 * median(without), "ms"),
        Figure("command, not recorded p99", 1000.0 * quantile(without, 0.99), "ms"),
        Figure("recorded / not recorded p50", median(with_log) / median(without), "times", MOST_TIMES),
    ]


def _switch(off: Path, recorded: bool) -> None:
    if recorded:
        off.unlink(missing_ok=True)
    else:
        off.touch()
