"""The console's other tasks: Play to the robot's arm, a robot with 500 topics."""

from __future__ import annotations

import asyncio
import time

from benchmarks.harness import Figure, progress, quantile
from benchmarks.parts.chromium import topics_shown_s
from benchmarks.parts.observer import Observer, start_ros_side
from robots.shared import wire
from script.stack.client import Driver, sign_in
from script.stack.stack import Stack, temporary_stack

ROBOT = "tiago-1"
MOTION = "head_tour"  # moves no joint of the arm, so it is never refused because of obstacles
REPEATS = 40
PLAY_P50_MS = 10.0
TOPICS = 500
FIRST_PAINT_S = 1.0


def measure() -> list[Figure]:
    """Start a console with three robots and use one."""
    with temporary_stack() as stack:
        return asyncio.run(measure_on(stack))


async def measure_on(stack: Stack) -> list[Figure]:
    """Return all figures, one phase after the other."""
    operator = await asyncio.to_thread(sign_in, stack, "operator")
    figures: list[Figure] = []
    async with Observer(stack.robots[ROBOT], "goals") as observer, Driver(stack, ROBOT, operator) as driver:
        progress("Play ...")
        figures += await play(driver, observer)
    progress(f"{TOPICS} topics in Chromium ...")
    many = start_ros_side(stack, stack.robots[ROBOT], "many")
    figures.append(
        Figure(
            f"{TOPICS} topics: first paint",
            await topics_shown_s(stack, ROBOT, operator, TOPICS),
            "s",
            FIRST_PAINT_S,
        )
    )
    stack.release(many)
    return figures


async def play(driver: Driver, observer: Observer) -> list[Figure]:
    """Measure from the message on the public WebSocket to the goal at another node, with the audit commit."""
    await driver.take()
    await driver.until(lambda: driver.state and all(sensor.ok for sensor in driver.state.sensors))
    delays_s: list[float] = []
    for seq in range(1, REPEATS + 1):
        await driver.until(lambda: driver.state and driver.state.motion is None)
        observer.forget()
        fence = driver.fence or 0
        sent_s = time.monotonic()
        await driver.send(wire.Play(fence, MOTION, 2 * seq))
        await observer.until(lambda: observer.goals)
        delays_s.append(observer.goals[0] - sent_s)
        await driver.until(lambda: driver.state and driver.state.motion is not None)
        await driver.send(wire.PlayCancel(fence, 2 * seq + 1))
    return [
        Figure("Play to goal p50", 1000.0 * quantile(delays_s, 0.50), "ms", PLAY_P50_MS),
        Figure("Play to goal p99", 1000.0 * quantile(delays_s, 0.99), "ms"),
    ]
