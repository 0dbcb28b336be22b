"""An observer of a robot from outside: it reads the lines of `ros_side observe` on the event loop."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import time
from collections.abc import Callable
from typing import NamedTuple

from script.stack.places import REPOSITORY
from script.stack.processes import Child
from script.stack.stack import SimulatedRobot, Stack

ROS_SIDE = "benchmarks.parts.ros_side"
SYSTEM_PYTHON = "/usr/bin/python3"  # which has rospy


class Seen(NamedTuple):
    """A velocity, and its time (seconds, CLOCK_MONOTONIC)."""

    at_s: float
    vx: float
    vy: float
    w: float

    @property
    def still(self) -> bool:
        """Return whether the velocity is exactly zero."""
        return self.vx == self.vy == self.w == 0.0


class Observer:
    """Async context: collects commands, and on request odometry or scans."""

    def __init__(self, robot: SimulatedRobot, *also: str) -> None:
        self._robot = robot
        self._also = also
        self.commands: list[Seen] = []
        self.odometry: list[Seen] = []
        self.truth: list[Seen] = []  # the true motion of the base, independent of its odometry
        self.scans: list[float] = []
        self.goals: list[float] = []  # of motions
        self.bare_s: list[float] = []  # delays
        self._ready = False
        self._news = asyncio.Condition()

    async def __aenter__(self) -> Observer:
        self._process = await asyncio.create_subprocess_exec(
            *("/usr/bin/setpriv", "--pdeathsig", "TERM"),
            *self._robot.plan.inside,
            *ros_side(self._robot, "observe", *self._also),
            cwd=REPOSITORY,
            env=self._robot.environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        self._reader = asyncio.create_task(self._read())
        await self.until(lambda: self._ready, 20.0)
        return self

    async def __aexit__(self, *_: object) -> None:
        if self._process.returncode is None:
            self._process.terminate()
        await self._process.wait()
        await self._reader

    @property
    def pid(self) -> int:
        """Return the observer's process id."""
        return self._process.pid

    async def cause(self, fault: str) -> None:
        """Give the simulated robot a fault; "none" ends it."""
        assert self._process.stdin is not None  # noqa: S101 - we asked for a pipe
        self._process.stdin.write(f"{fault}\n".encode())
        await self._process.stdin.drain()

    def forget(self) -> None:
        """Drop all collected messages."""
        for seen in (self.commands, self.odometry, self.truth, self.scans, self.goals, self.bare_s):
            seen.clear()

    async def until(self, condition: Callable[[], object], timeout_s: float = 10.0) -> None:
        """Wait until `condition()` is true, which is checked after every message. Raises `TimeoutError`."""
        try:
            await asyncio.wait_for(self._become(condition), timeout_s)
        except TimeoutError:
            code = self._process.returncode
            ended = "" if code is None else f" The observer ended with code {code}."
            raise TimeoutError(f"Waited {timeout_s:g} s in vain for the robot.{ended}") from None

    async def _become(self, condition: Callable[[], object]) -> None:
        async with self._news:
            await self._news.wait_for(lambda: bool(condition()))

    async def _read(self) -> None:
        assert self._process.stdout is not None  # noqa: S101 - we asked for a pipe
        async for line in self._process.stdout:
            kind, *values = line.decode().split()
            async with self._news:
                self._keep(kind, values)
                self._news.notify_all()

    def _keep(self, kind: str, values: list[str]) -> None:
        if kind == "ready":
            self._ready = True
            return
        at_s = int(values[0]) / 1e9
        numbers = [float(value) for value in values[1:]]
        match kind:
            case "command":
                self.commands.append(Seen(at_s, *numbers))
            case "odometry":
                self.odometry.append(Seen(at_s, *numbers))
            case "truth":
                self.truth.append(Seen(at_s, *numbers))
            case "scan":
                self.scans.append(at_s)
            case "goal":
                self.goals.append(at_s)
            case "bare":
                self.bare_s.append(at_s - numbers[0])


def start_ros_side(stack: Stack, robot: SimulatedRobot, role: str) -> Child:
    """Start another role of `ros_side`. The process ends with the stack, or by `end_all`."""
    name = f"bench-{role}-{time.monotonic_ns()}"
    return stack.start_child(name, ros_side(robot, role), robot.environment)


def ros_side(robot: SimulatedRobot, *words: str) -> list[str]:
    """Return the command of a role, with the library of this robot's ROS."""
    if robot.plan.ros == 1:
        return [SYSTEM_PYTHON, "-m", ROS_SIDE, "rospy", *words]
    return [sys.executable, "-m", ROS_SIDE, "rclpy", *words]
