"""Time from a press or fault to zero velocity and to standstill, seen by an independent ROS process; worst of 20.

With a robot of ROS 1, then with one of ROS 2, which has no master (`FLEET_BENCH_PARTS`: one of them, see PARTS).
`FLEET_BENCH_REPEATS`: how often each fault happens.
"""

from __future__ import annotations

import asyncio
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import asdict, dataclass, replace
from typing import NamedTuple

from websockets.exceptions import ConnectionClosed

from benchmarks.driving.separate_network import UNSHARE, RobotApart
from benchmarks.harness import Figure, progress
from benchmarks.parts import process_stats
from benchmarks.parts.cable import Cable
from benchmarks.parts.observer import Observer
from benchmarks.parts.with_ros2 import with_ros2
from script.stack.client import DRIVE_PERIOD_S, Driver, sign_in
from script.stack.stack import PRACTICE_ROBOTS, Stack, temporary_stack

ROBOT = "tiago-1"
PARTS = ("ros1", "ros2")
REPEATS = int(os.environ.get("FLEET_BENCH_REPEATS", "20"))
TURN = 0.6  # of the stick: a turn on the spot meets no obstacle, so only the fault ends it
SHARE = 0.4
MOVING_RADPS = 0.4
STILL_RADPS = 0.01
BRAKING = 0.9  # times the speed before the fault: below it the base brakes
OBSERVED_S = 3.0
ZERO_S = 0.5  # how long to look for a zero command once the base stands
AT_ONCE_S = 0.1
DEAD_MAN_S = 0.35
SETTLED_S = 1.0  # until TCP's buffers have arrived


class Timing(NamedTuple):
    """Seconds from the fault to each event; infinite: the event was not seen."""

    zero_s: float  # first zero command
    braking_s: float  # the base slows down
    still_s: float  # the base stands


@dataclass
class Person:
    """A person at a control page who holds the stick until `turn` changes."""

    stack: Stack
    cookie: str
    port: int | None = None
    driver: Driver | None = None
    turn: float = 0.0

    async def drive(self) -> None:
        """Keep the stick at `turn`. Move it to the middle when the console demands neutral."""
        while True:
            await asyncio.sleep(DRIVE_PERIOD_S)
            driver = self.driver
            if driver is None or driver.fence is None:
                continue
            middle = driver.state is not None and driver.state.neutral_needed is not None
            with suppress(ConnectionClosed):
                await driver.drive(0.0, 0.0 if middle else self.turn, SHARE)

    async def sit_down(self) -> Driver:
        """Return a page with control. Open a new page if the last page is closed."""
        if self.driver is None or self.driver.closed:
            await self.leave()
            self.driver = await Driver(self.stack, ROBOT, self.cookie, port=self.port).__aenter__()
        driver = self.driver
        await driver.until(lambda: driver.state, 20.0)
        if driver.fence is None:
            await driver.take()
        if driver.state and driver.state.stop.state != "clear":
            await driver.clear()
        return driver

    async def leave(self) -> None:
        """Close the page."""
        if self.driver is not None:
            driver, self.driver = self.driver, None
            await driver.__aexit__()


class Scene:
    """The console, one robot that turns on the spot, and an observer."""

    def __init__(self, stack: Stack, person: Person, observer: Observer) -> None:
        self.stack = stack
        self.person = person
        self.observer = observer
        self.robot = stack.robots[ROBOT]

    async def moving(self) -> Driver:
        """Wait until everything works and the base turns at a steady speed."""
        driver = await self.person.sit_down()
        self.person.turn = TURN
        self.observer.forget()
        # Odometry may come before commands: with ROS 2 each topic finds its readers by itself
        await self.observer.until(lambda: self.observer.commands and self._turns_steadily(), 20.0)
        return driver

    def _turns_steadily(self) -> bool:
        last = self.observer.odometry[-10:]
        return len(last) == 10 and all(seen.w > MOVING_RADPS for seen in last)

    async def timing(self, fault_s: float) -> Timing:
        """Return the timing of what followed a fault. Release the stick once the base stands."""
        steady = max(seen.w for seen in self.observer.odometry[-10:])
        seen = self.observer
        with suppress(TimeoutError):
            await seen.until(
                lambda: (
                    bool(seen.odometry)
                    and seen.odometry[-1].at_s > fault_s
                    and abs(seen.odometry[-1].w) < STILL_RADPS
                ),
                OBSERVED_S,
            )
        with suppress(TimeoutError):  # a base that the gate slows down may stand before the first zero
            await seen.until(lambda: any(one.still and one.at_s >= fault_s for one in seen.commands), ZERO_S)
        self.person.turn = 0.0
        zero = (command.at_s for command in seen.commands if command.still and command.at_s >= fault_s)
        after = [one for one in seen.odometry if one.at_s >= fault_s]
        braking = (one.at_s for one in after if one.w < BRAKING * steady)
        still = (one.at_s for one in after if abs(one.w) < STILL_RADPS)
        return Timing(*(next(times, float("inf")) - fault_s for times in (zero, braking, still)))


Fault = Callable[[Scene, Driver], Awaitable[float]]  # causes the fault; returns its time
Repair = Callable[[Scene], Awaitable[None]]


async def nothing(_scene: Scene) -> None:
    """Repair nothing, for faults that break nothing."""


async def repeat(name: str, scene: Scene, fault: Fault, repair: Repair = nothing) -> list[Timing]:
    """Cause the fault `REPEATS` times, each while the base turns. Return the timings."""
    progress(f"{name} ...")
    timings = []
    for _ in range(REPEATS):
        driver = await scene.moving()
        timings.append(await scene.timing(await fault(scene, driver)))
        await repair(scene)
    return timings


def to_zero(name: str, timings: list[Timing], limit_s: float | None) -> list[Figure]:
    """Return the worst times until the first zero command and until standstill."""
    zero_s = max(timing.zero_s for timing in timings)
    still_s = max(timing.still_s for timing in timings)
    return [
        Figure(f"{name} -> zero", zero_s, "s", limit_s),
        Figure(f"{name} -> standstill", still_s, "s"),
    ]


def to_braking(name: str, timings: list[Timing]) -> list[Figure]:
    """Return the worst times until the robot's own controller brakes, after faults that end all commands."""
    return [
        Figure(f"{name} -> braking", max(timing.braking_s for timing in timings), "s", DEAD_MAN_S),
        Figure(f"{name} -> standstill", max(timing.still_s for timing in timings), "s"),
    ]


def measure() -> list[Figure]:
    """Measure all faults for each ROS: on one console, then the cut to a robot in a separate network."""
    parts = os.environ.get("FLEET_BENCH_PARTS", " ".join(PARTS)).split()
    figures: list[Figure] = []
    if "ros1" in parts:
        with temporary_stack(PRACTICE_ROBOTS[:1]) as stack:
            figures += asyncio.run(faults_of_the_console(stack))
            figures += to_zero("master killed", asyncio.run(kills_of_the_master(stack)), DEAD_MAN_S)
        figures += cut_to_the_robot(1)
    if "ros2" in parts:
        found = with_ros2([replace(PRACTICE_ROBOTS[0], ros=2)], faults_of_the_console)
        found += cut_to_the_robot(2)
        figures += [replace(figure, name=f"ROS 2: {figure.name}") for figure in found]
    return figures


@asynccontextmanager
async def scene_on(stack: Stack, port: int | None = None) -> AsyncIterator[Scene]:
    """Context: a scene with a person at the stick and an observer."""
    cookie = await asyncio.to_thread(sign_in, stack, "operator")
    person = Person(stack, cookie, port)
    driving = asyncio.create_task(person.drive())
    try:
        async with Observer(stack.robots[ROBOT], "odometry") as observer:
            yield Scene(stack, person, observer)
    finally:
        driving.cancel()
        await person.leave()


async def faults_of_the_console(stack: Stack) -> list[Figure]:
    """Return the figures of all faults. Faults after which everything still runs come first."""
    figures: list[Figure] = []
    async with (
        Cable(("127.0.0.1", 0), ("127.0.0.1", stack.port)) as cable,
        scene_on(stack, cable.port) as scene,
    ):
        figures += to_zero("press", await repeat("press", scene, press), AT_ONCE_S)
        figures += to_zero("tab closed", await repeat("tab closed", scene, close_tab), AT_ONCE_S)
        timings = await repeat("tab's network cut", scene, freezing(cable), thawing(cable))
        figures += to_zero("tab's network cut", timings, DEAD_MAN_S)
    async with scene_on(stack) as scene:
        figures += to_zero(
            "laser dead", await repeat("laser dead", scene, kill_laser, mend_laser), DEAD_MAN_S
        )
        timings = await repeat("web process killed", scene, kill_web, restart_web)
        figures += to_zero("web process killed", timings, AT_ONCE_S)
    figures += await cuts_of_the_link(stack)
    async with scene_on(stack) as scene:
        timings = await repeat("bridge killed", scene, kill_bridge, restart_supervisor)
        figures += to_braking("bridge killed", timings)
        timings = await repeat("supervisor killed", scene, kill_supervisor, restart_supervisor)
        figures += to_zero("supervisor killed", timings, DEAD_MAN_S)
    return figures


# --- faults ---------------------------------------------------------------------------------------


async def press(_scene: Scene, driver: Driver) -> float:
    """Press the stop on the page."""
    now_s = time.monotonic()
    await driver.stop()
    return now_s


async def close_tab(_scene: Scene, driver: Driver) -> float:
    """Close the page as a browser does."""
    now_s = time.monotonic()
    await driver.socket.close()
    return now_s


def freezing(cable: Cable) -> Fault:
    """Return a fault that freezes the cable: it carries no more bytes, and neither side notices."""

    async def freeze(_scene: Scene, _driver: Driver) -> float:
        cable.freeze()
        return time.monotonic()

    return freeze


def cutting(cable: Cable) -> Fault:
    """Return a fault that closes the cable's ends."""

    async def cut(_scene: Scene, _driver: Driver) -> float:
        now_s = time.monotonic()
        cable.cut()
        return now_s

    return cut


def thawing(cable: Cable) -> Repair:
    """Return a repair that closes hanging connections; new connections work."""

    async def thaw(scene: Scene) -> None:
        cable.cut()
        cable.thaw()
        await scene.person.leave()

    return thaw


async def kill_laser(scene: Scene, _driver: Driver) -> float:
    """Stop the scans."""
    await scene.observer.cause("laser_dead")
    return time.monotonic()


async def mend_laser(scene: Scene) -> None:
    """Start the scans again."""
    await scene.observer.cause("none")


async def kill_web(scene: Scene, _driver: Driver) -> float:
    """Kill the web process with SIGKILL."""
    now_s = time.monotonic()
    scene.stack.web.kill_group()
    return now_s


async def restart_web(scene: Scene) -> None:
    """Start a new web process on the same socket."""
    await scene.person.leave()
    scene.stack.start_web()
    await asyncio.to_thread(scene.stack.wait_web, time.monotonic() + 30.0)


async def kill_bridge(scene: Scene, _driver: Driver) -> float:
    """Kill the bridge with SIGKILL."""
    [bridge] = bridges(scene.stack)
    now_s = time.monotonic()
    os.kill(bridge, signal.SIGKILL)
    return now_s


def bridges(stack: Stack) -> list[int]:
    """Return the process ids of the bridges."""
    return [
        child
        for child in process_stats.children(stack.supervisor.pid)
        if "fleet.site.run_bridge" in process_stats.arguments(child)
    ]


async def kill_supervisor(scene: Scene, _driver: Driver) -> float:
    """Kill the fleet supervisor with SIGKILL."""
    now_s = time.monotonic()
    scene.stack.supervisor.signal(signal.SIGKILL)
    return now_s


async def restart_supervisor(scene: Scene) -> None:
    """Start a new fleet supervisor: its restart budget is unused."""
    scene.stack.release(scene.stack.supervisor)
    scene.stack.start_supervisor()
    await asyncio.to_thread(scene.stack.wait_online, ROBOT, time.monotonic() + 30.0)


# --- faults that need special set-ups --------------------------------------------------------------


async def cuts_of_the_link(stack: Stack) -> list[Figure]:
    """Put a cable in place of the bridge's socket, cut and freeze it, and return the figures."""
    here = stack.robots[ROBOT].link_path
    there = f"{here}.far"
    os.rename(here, there)
    try:
        async with Cable(here, there) as cable:
            stack.web.kill_group()
            stack.start_web()
            await asyncio.to_thread(stack.wait_web, time.monotonic() + 30.0)
            async with scene_on(stack) as scene:
                figures = to_zero("link cut", await repeat("link cut", scene, cutting(cable)), AT_ONCE_S)
                timings = await repeat("link silent", scene, freezing(cable), thawing(cable))
                return figures + to_zero("link silent", timings, DEAD_MAN_S)
    finally:
        os.rename(there, here)


async def kills_of_the_master(stack: Stack) -> list[Timing]:
    """Kill the master `REPEATS` times. After each fault, start master, robot and observer again."""
    progress("master killed ...")
    timings = []
    for _ in range(REPEATS):
        async with scene_on(stack) as scene:
            await scene.moving()
            now_s = time.monotonic()
            scene.robot.master.kill_group()
            timings.append(await scene.timing(now_s))
        stack.release(scene.robot.simulator)
        scene.robot.start_master()
        scene.robot.start_simulator()
        await asyncio.to_thread(stack.wait_online, ROBOT, time.monotonic() + 30.0)
    return timings


# --- a robot in a separate network ------------------------------------------------------------------


def cut_to_the_robot(ros: int) -> list[Figure]:
    """Run the measurement in a process with a separate network, because it pulls a cable out."""
    command = [*UNSHARE, sys.executable, "-m", "benchmarks.driving.stop", str(ros)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)  # noqa: S603
    if done.returncode:
        progress("robot's network cut: not measured; this machine may not allow separate networks")
        return [Figure("robot's network cut -> braking", math.nan, "s", DEAD_MAN_S)]
    return [Figure(**figure) for figure in json.loads(done.stdout)]


def main() -> None:
    """Run the part in the separate network, with the ROS of the argument; print figures as JSON."""
    with RobotApart() as apart, temporary_stack([replace(apart.plan, ros=int(sys.argv[1]))]) as stack:
        figures = asyncio.run(cuts_of_the_robots_network(stack, apart))
    print(json.dumps([asdict(figure) for figure in figures]))


async def cuts_of_the_robots_network(stack: Stack, apart: RobotApart) -> list[Figure]:
    """Cut the robot's network: no command arrives.

    When the network is back, no old command may move the robot.
    """
    afterwards_radps: list[float] = []

    async def cut(_scene: Scene, _driver: Driver) -> float:
        now_s = time.monotonic()
        apart.cut()
        return now_s

    async def join(scene: Scene) -> None:
        scene.observer.forget()
        apart.join()
        await asyncio.to_thread(stack.wait_online, ROBOT, time.monotonic() + 30.0)
        await asyncio.sleep(SETTLED_S)
        afterwards_radps.append(max((abs(seen.w) for seen in scene.observer.odometry), default=0.0))

    async with scene_on(stack) as scene:
        timings = await repeat("robot's network cut", scene, cut, join)
    back = Figure("robot's network back: motion", max(afterwards_radps), "rad/s", STILL_RADPS)
    return [*to_braking("robot's network cut", timings), back]


if __name__ == "__main__":
    main()
