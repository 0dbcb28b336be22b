"""The rosbridge door: commands beside the page's, 50 readers of a laser, a map and pictures beside commands, a flood.

Readers and observers have a lower real-time priority than the console's loops: they would be on other computers.
An unauthenticated rosbridge needs 8.8 ms (p50) and 20 % of a core for 50 readers of a laser on a machine like ours; it
cannot be installed from Debian or PyPI, so limits are a third of these. A robot with ROS 2 is compared with one with
ROS 1 on the same console. `FLEET_BENCH_PARTS`, `FLEET_BENCH_SECONDS`,
`FLEET_BENCH_SLOTS`: fewer parts, shorter parts.
"""

from __future__ import annotations

import asyncio
import gc
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from itertools import count
from typing import Any, NamedTuple, Self

from benchmarks.driving.drive import BARE_STICKS, BOTH, SLOT, delays, drive
from benchmarks.harness import Figure, progress, quantile
from benchmarks.parts import process_stats
from benchmarks.parts.observer import Observer, start_ros_side
from benchmarks.parts.priority import prefer_loops_or_say, prefer_witness
from benchmarks.parts.viewer_crowd import Crowd
from benchmarks.parts.with_ros2 import with_ros2
from script.stack.client import Driver, open_socket, sign_in
from script.stack.places import REPOSITORY
from script.stack.stack import Stack, temporary_stack

ROBOT = "tiago-1"
PARTS = ("commands", "laser", "beside", "flood", "ros2")
SLOTS = 10
MEASURED_S = 20.0
SETTLED_S = 3.0
READERS = 50
PAGE_TIMES = 1.3
LASER_P50_MS, LASER_PERCENT = 8.8 / 3.0, 20.0 / 3.0
BESIDE_TIMES = 1.2
ROS2_TIMES = 1.3
BESIDE = {"grid": "a map of 1000 x 1000", "jpeg": "a 30 Hz JPEG", "picture": "a 30 Hz raw picture"}
FLOOD_P99_MS = 100.0
FLOOD_GROWTH_MB = 10.0


def measure() -> list[Figure]:
    """Start a console with three robots, and connect to one of them; then a console with a robot of each ROS."""
    gc.freeze()
    parts = os.environ.get("FLEET_BENCH_PARTS", " ".join(PARTS)).split()
    figures: list[Figure] = []
    if parts != ["ros2"]:
        with temporary_stack(BARE_STICKS) as stack:
            figures += asyncio.run(measure_on(stack, parts))
    if "ros2" in parts:
        figures += with_ros2(BOTH, compare_both)
    return figures


async def measure_on(stack: Stack, parts: Sequence[str]) -> list[Figure]:
    """Return the figures of these parts, one after the other."""
    prefer_loops_or_say(stack)
    bench = Bench(stack, await asyncio.to_thread(_token, stack), ROBOT)
    figures: list[Figure] = []
    for part in PARTS:
        if part in parts and part != "ros2":
            figures += await getattr(bench, part)()
    return figures


async def compare_both(stack: Stack) -> list[Figure]:
    """Read the same laser of a robot of each ROS, one after the other."""
    prefer_loops_or_say(stack)
    token = await asyncio.to_thread(_token, stack)
    figures: list[Figure] = []
    costs: list[dict[str, float]] = []
    for plan in BOTH:
        name = f"ROS {plan.ros}: laser, {READERS} readers"
        read = await Bench(stack, token, plan.slug).read_laser()
        costs.append({"p50": quantile(read.delays_s, 0.50), "web process and tap": read.web + read.tap})
        figures += [
            *delays(name, read.delays_s),
            Figure(f"{name}: web process adds", read.web, "%"),
            Figure(f"{name}: tap", read.tap, "%"),
        ]
    for what, ros1 in costs[0].items():
        figures.append(Figure(f"laser, {what}: ROS 2 / ROS 1", costs[1][what] / ros1, "times", ROS2_TIMES))
    return figures


def _token(stack: Stack) -> str:
    """Return the Authorization header of a program of the operator's."""
    command = [sys.executable, "manage.py", "make_token", stack.accounts["operator"].username, "bench"]
    made = subprocess.run(  # noqa: S603
        [*command, "drive", "topics"],
        cwd=REPOSITORY,
        env=stack.environment,
        stdout=subprocess.PIPE,
        check=True,
    )
    return f"Bearer {made.stdout.decode().strip()}"


class RosbridgeDriver:
    """A client of the rosbridge door that drives as `Driver` does; `page` knows the robot's limits."""

    def __init__(self, stack: Stack, token: str, page: Driver) -> None:
        self._opening = open_socket(stack, f"/rosbridge/{ROBOT}", token)
        self._numbers = count(1)
        self.robot = page.robot

    async def __aenter__(self) -> Self:
        self._socket = await self._opening.__aenter__()
        await self._send(op="advertise", topic="/cmd_vel", type="geometry_msgs/Twist")
        return self

    async def __aexit__(self, *error: Any) -> None:
        await self._opening.__aexit__(*error)

    async def call(self, service: str) -> None:
        """Call a service of the console. Raises RuntimeError if it refuses."""
        id_ = f"call {next(self._numbers)}"
        await self._send(op="call_service", service=service, id=id_)
        while True:
            answer = json.loads(await self._socket.recv())
            if answer.get("id") == id_ and answer["op"] == "service_response":
                if not answer["result"]:
                    raise RuntimeError(f"{service}: {answer['values']}")
                return

    async def drive(self, _x: float, w: float, share: float = 0.4) -> None:
        """Publish the velocity of this stick position."""
        assert self.robot is not None  # noqa: S101 - the page has received its welcome
        turn = w * share * self.robot.limits.turn_radps
        still = {"x": 0.0, "y": 0.0, "z": 0.0}
        await self._send(
            op="publish", topic="/cmd_vel", msg={"linear": still, "angular": still | {"z": turn}}
        )

    async def _send(self, **operation: Any) -> None:
        await self._socket.send(json.dumps(operation))


class LaserRead(NamedTuple):
    """The cost of reading: each delay, and the percent of a core that web process (added) and tap used."""

    delays_s: list[float]
    web: float
    tap: float


class Bench:
    """One robot, and clients of its rosbridge door."""

    def __init__(self, stack: Stack, token: str, slug: str) -> None:
        self._stack = stack
        self._robot = stack.robots[slug]
        self._token = token
        self._seconds = float(os.environ.get("FLEET_BENCH_SECONDS", MEASURED_S))
        self._slots = int(os.environ.get("FLEET_BENCH_SLOTS", SLOTS))

    async def commands(self) -> list[Figure]:
        """Drive by the page and by the door in turn."""
        progress("commands by the page and by the door, in turn ...")
        page_s: list[float] = []
        door_s: list[float] = []
        operator = await asyncio.to_thread(sign_in, self._stack, "operator")
        async with (
            Observer(self._robot) as observer,
            Driver(self._stack, ROBOT, operator) as page,
            RosbridgeDriver(self._stack, self._token, page) as door,
        ):
            prefer_witness(observer.pid)
            for _ in range(self._slots):
                await page.take()
                page_s += await drive(page, observer, SLOT)
                await page.release()
                await door.call("/fleet/take_control")
                door_s += await drive(door, observer, SLOT)  # type: ignore[arg-type]
                await door.call("/fleet/release_control")
        return [
            *delays("commands by the page", page_s),
            *delays("commands by rosbridge", door_s),
            *(
                Figure(
                    f"commands by rosbridge / by the page, p{100 * share:.0f}",
                    quantile(door_s, share) / quantile(page_s, share),
                    "times",
                    PAGE_TIMES,
                )
                for share in (0.50, 0.99)
            ),
        ]

    async def laser(self) -> list[Figure]:
        """Let many clients read a laser."""
        read = await self.read_laser()
        name = f"laser, {READERS} readers"
        return [
            Figure(f"{name}: p50", 1000.0 * quantile(read.delays_s, 0.50), "ms", LASER_P50_MS),
            Figure(f"{name}: p99", 1000.0 * quantile(read.delays_s, 0.99), "ms"),
            Figure(f"{name}: messages each", len(read.delays_s) / READERS / self._seconds, "/s"),
            Figure(f"{name}: web process adds", read.web, "%"),
            Figure(f"{name}: tap", read.tap, "%"),
            Figure(f"{name}: both", read.web + read.tap, "%", LASER_PERCENT),
        ]

    async def read_laser(self) -> LaserRead:
        """Let many clients read a laser; return delays and processor time."""
        progress(f"{READERS} readers of a laser, ROS {self._robot.plan.ros} ...")
        idle, _ = await self._used(0)
        laser = start_ros_side(self._stack, self._robot, "laser")
        async with self._readers("/bench_laser", READERS) as crowd:
            prefer_witness(crowd.pid)
            await crowd.until_all_see()
            await asyncio.sleep(SETTLED_S)
            crowd.seen.clear()
            web, tap = await self._used(self._tap())
            delays_s = _delays_s(crowd)
        self._stack.release(laser)
        return LaserRead(delays_s, web - idle, tap)

    async def beside(self) -> list[Figure]:
        """Drive by the page while one client reads a map, or pictures, and without, in turn.

        The messages are published all the time: only the work for the client differs.
        """
        figures: list[Figure] = []
        operator = await asyncio.to_thread(sign_in, self._stack, "operator")
        async with Observer(self._robot) as observer, Driver(self._stack, ROBOT, operator) as page:
            prefer_witness(observer.pid)
            await page.take()
            for role, what in BESIDE.items():
                progress(f"commands beside {what}, and without, in turn ...")
                publisher = start_ros_side(self._stack, self._robot, role)
                alone_s: list[float] = []
                beside_s: list[float] = []
                async with self._readers(f"/bench_{role}", 1) as crowd:
                    await crowd.until_all_see()
                    for _ in range(self._slots):
                        await crowd.watch(on=False)
                        await asyncio.sleep(0.5)
                        alone_s += await drive(page, observer, SLOT)
                        await crowd.watch(on=True)
                        crowd.seen.clear()
                        await crowd.until_all_see()
                        beside_s += await drive(page, observer, SLOT)
                self._stack.release(publisher)
                ratio = quantile(beside_s, 0.99) / quantile(alone_s, 0.99)
                figures += [
                    *delays(f"commands without {what}", alone_s),
                    *delays(f"commands beside {what}", beside_s),
                    Figure(f"commands beside {what} / without, p99", ratio, "times", BESIDE_TIMES),
                ]
        return figures

    async def flood(self) -> list[Figure]:
        """Let one client read ten thousand messages a second; measure their age, and memory."""
        progress("ten thousand messages a second ...")
        flood = start_ros_side(self._stack, self._robot, "tiny")
        async with self._readers("/bench_tiny", 1) as crowd:
            prefer_witness(crowd.pid)
            await crowd.until_all_see()
            await asyncio.sleep(SETTLED_S)
            crowd.seen.clear()
            pids = self._stack.web.pid, self._tap()
            before = [process_stats.resident_mb(pid) for pid in pids]
            web, tap = await self._used(pids[1])
            grown = [process_stats.resident_mb(pid) - mb for pid, mb in zip(pids, before, strict=True)]
            delays_s = _delays_s(crowd)
        self._stack.release(flood)
        return [
            Figure("10,000 a second: passed on", len(delays_s) / self._seconds, "/s"),
            Figure("10,000 a second: age p99", 1000.0 * quantile(delays_s, 0.99), "ms", FLOOD_P99_MS),
            Figure("10,000 a second: web process grows", grown[0], "MB", FLOOD_GROWTH_MB),
            Figure("10,000 a second: tap grows", grown[1], "MB", FLOOD_GROWTH_MB),
            Figure("10,000 a second: web process", web, "%"),
            Figure("10,000 a second: tap", tap, "%"),
        ]

    def _readers(self, topic: str, count: int) -> Crowd:
        return Crowd(self._stack, self._robot.plan.slug, self._token, count, topic=topic)

    def _tap(self) -> int:
        package = "robots.bridge.ros" if self._robot.plan.ros == 1 else "robots.bridge.ros2"
        [tap] = [
            child
            for bridge in process_stats.children(self._stack.supervisor.pid)
            for child in process_stats.children(bridge)
            if f"{package}.tap" in process_stats.arguments(child)
        ]
        return tap

    async def _used(self, tap: int) -> tuple[float, float]:
        """Return the percent of a core that web process and tap (its id, 0: none) use."""
        pids = [self._stack.web.pid, *([tap] if tap else [])]
        began_s, before_s = time.monotonic(), [process_stats.cpu_s(pid) for pid in pids]
        await asyncio.sleep(self._seconds)
        spent_s = time.monotonic() - began_s
        used = [
            100.0 * (process_stats.cpu_s(pid) - before) / spent_s
            for pid, before in zip(pids, before_s, strict=True)
        ]
        return used[0], sum(used[1:])


def _delays_s(crowd: Crowd) -> list[float]:
    """Return the time from sending to each client."""
    return [at_s - stamp / 1e9 for stamp, arrivals in crowd.seen.items() for at_s in arrivals.values()]
