"""A program's drive ends with its slot, in time for the person whose slot follows."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta

import pytest

from benchmarks.parts.observer import Observer
from robots.shared import wire
from script.stack.client import DRIVE_PERIOD_S, Driver
from script.stack.places import REPOSITORY
from script.stack.stack import PRACTICE_ROBOTS, Stack
from tests.script.support import token

ROBOT = PRACTICE_ROBOTS[0].slug
STANDS_S = 0.35  # after the end of the slot
SLOT_S = 20.0  # Python starts twice in this time, also on a busy computer
SHARE = 0.4
MOVING_RADPS = 0.1
STILL_RADPS = 0.01

SLOTS = """
import sys, django
django.setup()
from datetime import datetime
from fleet.accounts.models import User
from fleet.bookings.models import Booking
from robots.registry.models import Robot
times = [datetime.fromisoformat(text) for text in sys.argv[2:]]
robot = Robot.objects.get(slug=sys.argv[1])
for name, start, end in zip(("operator", "supervisor"), times, times[1:]):
    person = User.objects.get(username=name)
    slot = {"starts_at": start, "ends_at": end, "held_until": end}
    Booking.objects.create(robot=robot, person=person, made_at=start, **slot)
"""
NO_SLOTS = (
    "import django; django.setup(); from fleet.bookings.models import Booking; Booking.objects.all().delete()"
)


def run(stack: Stack, code: str, *arguments: str) -> None:
    environment = {**stack.environment, "DJANGO_SETTINGS_MODULE": "fleet.settings"}
    subprocess.run([sys.executable, "-c", code, *arguments], cwd=REPOSITORY, env=environment, check=True)


@pytest.fixture
def operator(stack: Stack) -> str:
    """The token of the operator's program, as a WebSocket sends it."""
    return f"Bearer {token(stack, 'operator', 'read', 'drive')}"


@pytest.fixture
def slot_end_s(stack: Stack) -> Iterator[float]:
    """The end of the operator's slot, on the monotonic clock; the supervisor's slot follows at once."""
    now = datetime.now(UTC)
    ends = now + timedelta(seconds=SLOT_S)
    times = now - timedelta(minutes=5), ends, ends + timedelta(minutes=30)
    run(stack, SLOTS, ROBOT, *(moment.isoformat() for moment in times))
    yield time.monotonic() + ends.timestamp() - time.time()
    run(stack, NO_SLOTS)


@pytest.mark.parametrize("way", ["stick", "drive_by"])
async def test_the_robot_stands_when_the_slot_is_over(
    stack: Stack, operator: str, slot_end_s: float, way: str
) -> None:
    async with Observer(stack.robots[ROBOT], "truth") as observer, Driver(stack, ROBOT, operator) as driver:
        await driver.until(lambda: driver.state and driver.state.phase == "online", 20.0)
        if driver.state and driver.state.stop.state != "clear":
            await driver.clear()
        await driver.take()
        driving = asyncio.ensure_future(hold_stick(driver) if way == "stick" else turn(driver))
        try:
            await observer.until(
                lambda: bool(observer.truth) and observer.truth[-1].w > MOVING_RADPS, SLOT_S / 2
            )
            await asyncio.sleep(slot_end_s + 1.0 - time.monotonic())
            await driver.until(lambda: driver.fence is None)
        finally:
            driving.cancel()
    moving = [seen.at_s for seen in observer.truth if abs(seen.w) > STILL_RADPS]
    assert any(slot_end_s - 0.2 < at_s < slot_end_s for at_s in moving), "it drove until the end of the slot"
    assert max(moving) - slot_end_s < STANDS_S


async def hold_stick(driver: Driver) -> None:
    while True:
        await driver.drive(0.0, 0.0 if driver.state and driver.state.neutral_needed else 0.6, SHARE)
        await asyncio.sleep(DRIVE_PERIOD_S)


async def turn(driver: Driver) -> None:
    answer = await driver.request_task(wire.DriveBy(driver.fence or 0, angle_rad=6.0, speed_radps=0.3))
    assert isinstance(answer, wire.Accepted), answer
