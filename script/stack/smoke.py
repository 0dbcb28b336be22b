"""The main function of the console, through its public interfaces: sign in, take control, drive a metre, stop."""

from __future__ import annotations

import asyncio
import math
import time

from script.stack.client import Driver, sign_in
from script.stack.stack import Stack

DISTANCE_M = 1.0


async def drive_and_stop(stack: Stack, robot: str) -> str:
    """Drive and stop a robot, and return one line of figures; raise `TimeoutError` if the robot does not obey."""
    cookie = await asyncio.to_thread(sign_in, stack, "operator")
    async with Driver(stack, robot, cookie) as driver:
        await driver.until(lambda: driver.odometry)
        fence = await driver.take()
        start = driver.odometry
        began_s = time.monotonic()

        def driven_m() -> float:
            now = driver.odometry
            return math.hypot(now.x - start.x, now.y - start.y) if start and now else 0.0

        await driver.hold_stick(1.0, 0.0, lambda: driven_m() >= DISTANCE_M)
        took_s = time.monotonic() - began_s
        await driver.stop()
        await driver.until(lambda: driver.state and driver.state.stop.state == "stopped")
        stop = driver.state.stop if driver.state else None
        standstill_ms = stop.standstill_ms if stop else None
        return (
            f"control under number {fence}, {driven_m():.2f} m driven in {took_s:.1f} s by odometry, "
            f"stop pressed, standstill after {standstill_ms or 0:.0f} ms"
        )
