"""Robots: what one costs at rest and under control, and how soon many are online after a start."""

from __future__ import annotations

import asyncio
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from benchmarks.growth.console import SECONDS
from benchmarks.harness import Figure
from benchmarks.parts import process_stats
from benchmarks.parts.with_ros2 import with_ros2
from script.stack.client import Driver, sign_in
from script.stack.database import with_tables
from script.stack.processes import Child
from script.stack.stack import PRACTICE_ROBOTS, PracticeRobot, Stack, temporary_stack

ROBOT = PRACTICE_ROBOTS[0]
ROBOTS = 20
SETTLED_S = 5.0
REST_S = 0.2  # between two messages of a stick at rest
ONLINE_S = 300.0


def cost() -> Iterator[Figure]:
    """Measure one simulated robot, then the start of a console with many light stand-ins."""
    with temporary_stack([ROBOT]) as stack:
        yield from asyncio.run(_one(stack, "one robot", Limits(2.0, 60.0, 26.0, 8.0)))
    with tempfile.TemporaryDirectory(prefix="fleet-growth-") as directory:
        with_tables(Path(directory))
        yield _Many(Path(directory)).started()


def cost_of_ros2() -> Iterator[Figure]:
    """Measure one simulated robot with ROS 2."""
    limits = Limits(6.0, 150.0)
    yield from with_ros2([replace(ROBOT, ros=2)], lambda stack: _one(stack, "one robot with ROS 2", limits))


class Limits(NamedTuple):
    """Limits of a robot's bridge and watchdog: percent of a core, MB."""

    bridge_at_rest: float
    bridge_mb: float
    watchdog_mb: float | None = None
    bridge_held: float | None = None


async def _one(stack: Stack, name: str, limits: Limits) -> list[Figure]:
    children = process_stats.children(stack.supervisor.pid)
    [bridge] = [child for child in children if "fleet.site.run_bridge" in process_stats.arguments(child)]
    [watchdog] = [child for child in children if "robots.bridge.watchdog" in process_stats.arguments(child)]
    cookie = await asyncio.to_thread(sign_in, stack, "operator")
    await asyncio.sleep(SETTLED_S)
    at_rest = await _used(bridge, watchdog)
    figures = [
        Figure(f"{name} at rest: bridge", at_rest[0], "%", limits.bridge_at_rest),
        Figure(f"{name} at rest: watchdog", at_rest[1], "%"),
        Figure(f"{name} at rest: bridge", process_stats.resident_mb(bridge), "MB", limits.bridge_mb),
        Figure(f"{name} at rest: watchdog", process_stats.resident_mb(watchdog), "MB", limits.watchdog_mb),
    ]
    async with Driver(stack, ROBOT.slug, cookie) as driver:
        await driver.take()
        resting = asyncio.create_task(_rest(driver))
        await asyncio.sleep(SETTLED_S)
        held = await _used(bridge)
        resting.cancel()
    return [
        *figures,
        Figure(f"{name}, control held, stick at rest: bridge", held[0], "%", limits.bridge_held),
        Figure(f"{name}, control held, stick at rest: bridge", process_stats.resident_mb(bridge), "MB"),
    ]


async def _rest(driver: Driver) -> None:
    while True:
        await driver.drive(0.0, 0.0)
        await asyncio.sleep(REST_S)


async def _used(*pids: int) -> list[float]:
    """Return the percent of a core that each process uses."""
    before, began_s = list(map(process_stats.cpu_s, pids)), time.monotonic()
    await asyncio.sleep(SECONDS)
    seconds = time.monotonic() - began_s
    return [
        100.0 * (process_stats.cpu_s(pid) - cpu_s) / seconds for pid, cpu_s in zip(pids, before, strict=True)
    ]


class _Many(Stack):
    """A console whose robots are stand-ins. They run before it starts."""

    def __init__(self, directory: Path) -> None:
        plans = [
            PracticeRobot(f"robot-{n}", f"Robot {n}", (0.0, 0.0, 0.0), is_on=False) for n in range(ROBOTS)
        ]
        super().__init__(directory, robots=plans)
        self._began_s = 0.0

    def _start_robots(self) -> None:
        super()._start_robots()
        ports = [str(robot.port.number) for robot in self.robots.values()]
        words = [sys.executable, "-m", "benchmarks.growth.robots_side", *ports]
        side = self.start_child("robots", words, {**self.environment, "ROS_IP": "127.0.0.1"})
        for _ in self._tries(time.monotonic() + ONLINE_S, "The stand-ins"):
            if "ready" in side.last_lines():
                return

    def start_supervisor(self) -> Child:
        """Start it, and note when."""
        self._began_s = time.monotonic()
        return super().start_supervisor()

    def started(self) -> Figure:
        """Start the console; return the time until all robots are online and people can sign in."""
        with self:
            for slug in self.robots:
                self.wait_online(slug, time.monotonic() + ONLINE_S)
            seconds = time.monotonic() - self._began_s
        return Figure(f"{ROBOTS} robots online after", seconds, "s", 60.0)
