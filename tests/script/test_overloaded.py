"""On an overloaded computer people can take control, and the console does not report missing commands."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from robots.shared.configuration.input_filters import COMMAND_LIFE_S
from script.stack.client import DRIVE_PERIOD_S, Driver, sign_in
from script.stack.stack import PRACTICE_ROBOTS, temporary_stack

BURNERS = (
    4  # with the console on one core, each process gets a fifth of it; other cores stay free for other tests
)
BURNED_S = 40  # s, after which the processes end by themselves
TAKES = 5
HELD_S = 5.0
BURN = f"import time\nend = time.monotonic() + {BURNED_S}\nwhile time.monotonic() < end: pass"


@contextmanager
def one_core() -> Iterator[None]:
    """Run this thread, and the processes that it starts, on one core."""
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


@contextmanager
def burners() -> Iterator[None]:
    """Run processes that use all processor time."""
    burning = [subprocess.Popen([sys.executable, "-c", BURN]) for _ in range(BURNERS)]
    try:
        yield
    finally:
        for burner in burning:
            burner.kill()
            burner.wait()


def test_an_overloaded_computer_loses_no_take_and_is_named():
    with one_core(), temporary_stack(PRACTICE_ROBOTS[:1]) as stack:
        cookie = sign_in(stack, "operator")
        with burners():
            asyncio.run(drive_under_load(stack, cookie))


async def drive_under_load(stack, cookie) -> None:
    for _ in range(TAKES):
        async with Driver(stack, "tiago-1", cookie) as driver:
            await driver.take()
            await hold(driver, HELD_S / TAKES)


async def hold(driver: Driver, seconds: float) -> None:
    """Turn on the spot. Check that no command is reported as missing while this client sends in time."""
    own_gap_s = 0.0
    sent_s = time.monotonic()
    end_s = sent_s + seconds
    while time.monotonic() < end_s:
        needed = driver.state.neutral_needed if driver.state else None
        if own_gap_s < COMMAND_LIFE_S / 2:
            assert needed is None or needed.code != "dead_man"
        await driver.drive(0.0, 0.0 if needed else 0.3)
        now_s = time.monotonic()
        own_gap_s, sent_s = max(own_gap_s, now_s - sent_s), now_s
        await asyncio.sleep(DRIVE_PERIOD_S)
