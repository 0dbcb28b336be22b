"""From the stick to the robot: delay of a command from the WebSocket to another rospy process, at 50 Hz.

Bare rospy and the console are measured in turn, slot by slot, so that a slow machine affects both. The limits
are ratios of the two: see docs/decisions/delays-are-compared-with-bare-rospy.md. The limits apply to a
console with real-time priority, as in docs/deployment.md. The figures without this priority are printed, too.
A robot with ROS 2 stands beside one with ROS 1 on another console: what this adds to bare rclpy is compared with what
it adds to bare rospy.
"""

from __future__ import annotations

import asyncio
import gc
import math
import os
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import replace

from websockets.exceptions import ConnectionClosed

from benchmarks.harness import Figure, progress, quantile
from benchmarks.parts.bare import Bare
from benchmarks.parts.observer import Observer, Seen, start_ros_side
from benchmarks.parts.priority import prefer_loops_or_say
from benchmarks.parts.viewer_crowd import Crowd
from benchmarks.parts.with_ros2 import with_ros2
from robots.shared.configuration.input_filters import COMMAND_LIFE_S
from script.stack.client import Driver, sign_in
from script.stack.stack import PRACTICE_ROBOTS, Stack, temporary_stack

ROBOT = "tiago-1"
PERIOD_S = 0.02
PARTS = ("alone", "viewers", "map", "flood", "ros2")
SLOTS = 10  # of bare rospy and of the console each, in turn
SLOT = 150  # commands: three seconds
WARM_UP = 50  # commands, until the base turns at its speed
VIEWERS = 50
FLOOD_S = 0.5
SHARE = 0.4
# Limits as multiples of bare rospy in the same slots. A rosbridge without authentication reaches the first
# two.
P50_TIMES = 3.9
P99_TIMES = 1.8
BESIDE_P99_TIMES = 2.9  # with viewers, or a map
ADDED_TIMES = 1.2  # what the console adds to bare rclpy, times what it adds to bare rospy
LEAST_S = 1e-6  # that it adds: on a busy computer a bare p99 may be the longer one
# Each command has a slightly different turning speed, by which it is recognised in the observer's Twists. The
# gate never reduces this speed, because a disc that turns on the spot meets no obstacle. The stick filter is
# off.
TURN = 0.30
STEP = 1e-6
BARE_STICKS = tuple(replace(robot, stick=()) for robot in PRACTICE_ROBOTS)
BOTH = (BARE_STICKS[0], replace(BARE_STICKS[2], ros=2))


def measure() -> list[Figure]:
    """Start a console with three robots and drive one; then another with a robot of each ROS.

    `FLEET_BENCH_PARTS`, `FLEET_BENCH_SLOTS`: measure less.
    """
    gc.freeze()
    parts = os.environ.get("FLEET_BENCH_PARTS", " ".join(PARTS)).split()
    figures: list[Figure] = []
    if parts != ["ros2"]:
        with temporary_stack(BARE_STICKS) as stack:
            figures += asyncio.run(measure_on(stack, parts))
    if "ros2" in parts:
        figures += with_ros2(BOTH, added_to_both)
    return figures


async def measure_on(stack: Stack, parts: Sequence[str]) -> list[Figure]:
    """Return the figures of these parts, one after the other."""
    figures: list[Figure] = []
    async with slots_of(stack, ROBOT) as slots:
        if "alone" in parts:
            figures += await slots.compare("ordinary priority", None, None)
        prefer_loops_or_say(stack)
        if "alone" in parts:
            figures += await slots.compare("Python", P50_TIMES, P99_TIMES)
        if "viewers" in parts:
            observer_cookie = await asyncio.to_thread(sign_in, stack, "observer")
            async with Crowd(stack, ROBOT, observer_cookie, VIEWERS):
                figures += await slots.compare(f"with {VIEWERS} viewers", None, BESIDE_P99_TIMES)
        if "map" in parts:
            maps = [start_ros_side(stack, stack.robots[ROBOT], role) for role in ("map", "watch_map")]
            figures += await slots.compare("with a map", None, BESIDE_P99_TIMES)
            stack.release(*maps)
        if "flood" in parts:
            progress("flood ...")
            figures += await flood(slots.driver, slots.observer)
    return figures


async def added_to_both(stack: Stack) -> list[Figure]:
    """Drive a robot of each ROS in turn; compare what the console adds to its client library."""
    prefer_loops_or_say(stack)
    # The console's twists go to the robot and to the observer: bare ones go to two listeners too.
    for plan in BOTH:
        start_ros_side(stack, stack.robots[plan.slug], "watch_bare")
    progress("rospy and rclpy, bare and by the console, in turn ...")
    delays_s: dict[str, list[float]] = {}
    async with slots_of(stack, BOTH[0].slug) as ros1, slots_of(stack, BOTH[1].slug) as ros2:
        for _ in range(ros1.count):
            for library, slots in (("rospy", ros1), ("rclpy", ros2)):
                delays_s.setdefault(f"bare {library}", []).extend(await slots.bare.delays_s(SLOT))
                driven_s = await drive(slots.driver, slots.observer)
                delays_s.setdefault(f"console by {library}", []).extend(driven_s)
    figures = [figure for name, seconds in delays_s.items() for figure in delays(name, seconds)]
    for share in (0.50, 0.99):
        by = {name: quantile(seconds, share) for name, seconds in delays_s.items()}
        added_s = {
            library: by[f"console by {library}"] - by[f"bare {library}"] for library in ("rospy", "rclpy")
        }
        figures.append(
            Figure(
                f"p{100 * share:.0f} that the console adds to bare rclpy / to bare rospy",
                added_s["rclpy"] / max(added_s["rospy"], LEAST_S),
                "times",
                ADDED_TIMES,
            )
        )
    return figures


@asynccontextmanager
async def slots_of(stack: Stack, slug: str) -> AsyncIterator[Slots]:
    """Context: a driver, an observer and a bare publisher of a robot."""
    robot = stack.robots[slug]
    operator = await asyncio.to_thread(sign_in, stack, "operator")
    async with Observer(robot) as observer:
        with Bare(stack, robot, observer) as bare:
            async with Driver(stack, slug, operator) as driver:
                await driver.take()
                yield Slots(bare, driver, observer)


class Slots:
    """Runs bare rospy and the console in turn."""

    def __init__(self, bare: Bare, driver: Driver, observer: Observer) -> None:
        self.bare, self.driver, self.observer = bare, driver, observer
        self.count = int(os.environ.get("FLEET_BENCH_SLOTS", SLOTS))

    async def compare(self, name: str, p50_times: float | None, p99_times: float | None) -> list[Figure]:
        """Return the delays of both, and their ratios with these limits."""
        progress(f"{name}, in turn with bare rospy ...")
        bare_s: list[float] = []
        ours_s: list[float] = []
        for _ in range(self.count):
            bare_s += await self.bare.delays_s(SLOT)
            ours_s += await drive(self.driver, self.observer)
        return [
            *delays(f"bare rospy ({name})", bare_s),
            *delays(name, ours_s),
            times(f"{name} p50", ours_s, bare_s, 0.50, p50_times),
            times(f"{name} p99", ours_s, bare_s, 0.99, p99_times),
        ]


def delays(name: str, delays_s: Sequence[float]) -> list[Figure]:
    """Return p50, p90 and p99 in milliseconds."""
    return [
        Figure(f"{name} p{share:.0f}", 1000.0 * quantile(delays_s, share / 100), "ms")
        for share in (50, 90, 99)
    ]


def times(
    name: str, delays_s: Sequence[float], bare_s: Sequence[float], share: float, limit: float | None
) -> Figure:
    """Return the ratio to bare rospy."""
    return Figure(f"{name} / bare rospy", quantile(delays_s, share) / quantile(bare_s, share), "times", limit)


class Numbers:
    """Recognises by the turning speed which command caused a Twist."""

    def __init__(self, full_turn_radps: float) -> None:
        self._scale = SHARE * full_turn_radps

    def turn(self, number: int) -> float:
        """Return the stick position of command `number`."""
        return TURN + number * STEP

    def number(self, command: Seen) -> int | None:
        """Return the number of the command that caused a Twist; None: the Twist is not ours."""
        steps = (command.w / self._scale - TURN) / STEP
        number = round(steps)
        return number if math.isclose(steps, number, abs_tol=0.1) else None

    def arrivals(self, commands: Sequence[Seen]) -> dict[int, float]:
        """Return the first arrival of each command; later ones are repetitions by the bridge."""
        first: dict[int, float] = {}
        for command in commands:
            number = self.number(command)
            if number is not None:
                first.setdefault(number, command.at_s)
        return first


def numbers_for(driver: Driver) -> Numbers:
    """Return `Numbers` for the robot's speed limits."""
    assert driver.robot is not None  # noqa: S101 - a driver has received its welcome
    return Numbers(driver.robot.limits.turn_radps)


async def drive(driver: Driver, observer: Observer, samples: int = SLOT) -> list[float]:
    """Return the delays of commands at 50 Hz. A command that never arrives counts as infinite."""
    numbers = numbers_for(driver)
    await driver.drive(0.0, 0.0)  # neutral first: nobody drove since the last phase
    observer.forget()
    sent: dict[int, float] = {}
    due_s = time.monotonic()
    for number in range(WARM_UP + samples):
        sent[number] = time.monotonic()
        await driver.drive(0.0, numbers.turn(number), SHARE)
        due_s += PERIOD_S
        await asyncio.sleep(max(0.0, due_s - time.monotonic()))
    await asyncio.sleep(0.2)
    arrived = numbers.arrivals(observer.commands)
    return [arrived.get(number, math.inf) - sent[number] for number in range(WARM_UP, WARM_UP + samples)]


async def flood(driver: Driver, observer: Observer) -> list[Figure]:
    """Flood the socket with commands for 0.5 s; return the age of the oldest one that is carried out."""
    numbers = numbers_for(driver)
    await hold_turn(driver, numbers)
    observer.forget()
    sent: dict[int, float] = {}
    began_s = time.monotonic()
    with suppress(ConnectionClosed):  # the console soon closes a flooding connection
        while (now_s := time.monotonic()) < began_s + FLOOD_S:
            sent[len(sent)] = now_s
            await driver.drive(0.0, numbers.turn(len(sent) - 1), SHARE)
    await asyncio.sleep(1.0)
    ages_s = [
        command.at_s - sent[number]
        for command in observer.commands
        if (number := numbers.number(command)) in sent and number is not None
    ]
    return [
        Figure("flood: commands sent", len(sent), ""),
        Figure("flood: oldest carried out", 1000.0 * max(ages_s, default=0.0), "ms", 1000.0 * COMMAND_LIFE_S),
    ]


async def hold_turn(driver: Driver, numbers: Numbers) -> None:
    """Turn until the base has reached its speed, so that rate limits have no effect."""
    await driver.drive(0.0, 0.0)
    for _ in range(WARM_UP):
        await driver.drive(0.0, numbers.turn(0), SHARE)
        await asyncio.sleep(PERIOD_S)
