"""A scripted session, and kill -9 of the processes between person and robot meanwhile."""

from __future__ import annotations

import asyncio
import os
import random
import secrets
import signal
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from itertools import count, cycle
from types import TracebackType
from typing import Any, Protocol

import msgspec
from websockets.exceptions import ConnectionClosed

from benchmarks.parts import process_stats
from benchmarks.parts.audit.reconciliation import Log, Received, counts, unfinished, unrecorded
from benchmarks.stop import ROBOT, STILL_RADPS, TURN, bridges
from robots import wire
from script.stack.client import Driver
from script.stack.stack import Stack

PARTS = ("web", "bridge", "database")
EARLIEST_S, LATEST_S = 0.5, 2.5  # of a round's session, when the kill comes
STILL_RUNS_S = 0.3  # how long the session goes on after the kill, for those who live
READY_S = 90.0  # a supervisor whose restart budget is spent rests for a minute
SETTLED_S = 10.0
ANSWER_S = 20.0
OTHER_DRIVE_TOPIC = "/phone_vel"


class LostError(AssertionError):
    """Something reached the robot that is not on record, or the log is not as it must be."""


class Database(Protocol):
    """Holder of a stack's log."""

    writers_too: bool  # whether web process and bridge die with it

    def kill(self, stack: Stack) -> None:
        """kill -9, in the middle of whatever it writes."""

    def start(self, stack: Stack) -> None:
        """Start again what does not start itself, but for the web process."""


class Embedded:
    """SQLite in the processes that write: all of them are killed at once, and the file must be whole."""

    writers_too = True

    def kill(self, stack: Stack) -> None:
        """kill -9 of web process, supervisor, bridge and housekeeping; then SQLite looks at the file."""
        for pid in (stack.web.pid, stack.supervisor.pid, *process_stats.children(stack.supervisor.pid)):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        with closing(sqlite3.connect(stack.directory / "fleet.sqlite3", timeout=10.0)) as database:
            told = database.execute("PRAGMA integrity_check").fetchall()
        if told != [("ok",)]:
            raise LostError(f"the database is damaged: {told}")

    def start(self, stack: Stack) -> None:
        """The supervisor, which starts the others."""
        stack.release(stack.supervisor)
        stack.start_supervisor()


class Witness:
    """Async context: collects what reaches the robot."""

    def __init__(self, stack: Stack) -> None:
        self._stack = stack
        self._received: list[Received] = []
        self._goals: dict[str, Received] = {}
        self._ready = asyncio.Event()

    async def __aenter__(self) -> Witness:
        self._process = await asyncio.create_subprocess_exec(
            *("/usr/bin/setpriv", "--pdeathsig", "TERM"),
            *(sys.executable, "-m", "benchmarks.parts.witness_side"),
            env=self._stack.robots[ROBOT].environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        self._reader = asyncio.create_task(self._read())
        await asyncio.wait_for(self._ready.wait(), ANSWER_S)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._process.returncode is None:
            self._process.terminate()
        await self._process.wait()
        await self._reader

    @property
    def received(self) -> list[Received]:
        """Everything so far; of each goal one."""
        return [*self._received, *self._goals.values()]

    @property
    def last_velocity_s(self) -> float:
        """When the robot was told to move last, Unix time."""
        return max((one.at_s for one in self._received if one.kind == "drive.start"), default=0.0)

    async def _read(self) -> None:
        assert self._process.stdout is not None  # noqa: S101 - we asked for a pipe
        async for line in self._process.stdout:
            one = msgspec.json.decode(line, type=Received)
            if one.kind == "ready":
                self._ready.set()
            elif not one.goal:
                self._received.append(one)
            elif one.key or one.goal not in self._goals:
                self._goals[one.goal] = one


class Person:
    """Somebody at a control page who does a little of everything, again and again, and goes on where they were."""

    def __init__(self, stack: Stack, cookie: str, seed: int = 0) -> None:
        self._stack = stack
        self._cookie = cookie
        self.chance = random.Random(seed)  # noqa: S311 - of whatever is random in its rounds
        self._tab = secrets.token_urlsafe(24)
        self._numbers = count(1)
        steps: list[Callable[[Driver], Awaitable[Any]]] = [
            *(self._say, self._turn, self._publish, self._play, self._turn, self._say, self._choose),
            *(self._turn, self._publish, self._choose_default, self._stop_and_clear),
        ]
        self._steps = cycle(steps)

    async def sit_down(self) -> Driver:
        """The page, with control, the stop cleared and the stick in the middle."""
        driver = await Driver(self._stack, ROBOT, self._cookie, tab=self._tab).__aenter__()
        await driver.until(lambda: driver.state and driver.state.phase == "online", ANSWER_S)
        end_s = time.monotonic() + ANSWER_S
        while driver.fence is None and time.monotonic() < end_s:
            await driver.send(wire.Take())
            with suppress(TimeoutError):
                await driver.until(lambda: driver.fence is not None, 0.5)
        await driver.until(lambda: driver.state and driver.fence and driver.state.fence == driver.fence)
        await driver.drive(0.0, 0.0)
        if driver.state and driver.state.stop.state != "clear":
            await driver.clear()
        return driver

    async def go_on(self, driver: Driver) -> None:
        """Step after step, until cancelled or the connection is gone."""
        with suppress(ConnectionClosed):
            for step in self._steps:
                await step(driver)

    async def _say(self, driver: Driver) -> None:
        await driver.order(wire.Say(driver.fence or 1, f"Sentence {next(self._numbers)}.", "en-GB"))

    async def _publish(self, driver: Driver) -> None:
        fields = {"data": f"Note {next(self._numbers)}."}
        order = wire.Publish(driver.fence or 1, "/fleet_demo/notes", "std_msgs/String", fields)
        await driver.order(order)

    async def _play(self, driver: Driver) -> None:
        await self._stand(driver)
        await driver.order(wire.Play(driver.fence or 1, "open"))
        await driver.until(lambda: driver.state and not driver.state.motion)

    async def _choose(self, driver: Driver) -> None:
        await self._stand(driver)
        await driver.order(wire.Choose(driver.fence or 1, "drive", OTHER_DRIVE_TOPIC))

    async def _choose_default(self, driver: Driver) -> None:
        await self._stand(driver)
        await driver.order(wire.Choose(driver.fence or 1, "drive"))

    async def _turn(self, driver: Driver) -> None:
        end_s = time.monotonic() + self.chance.uniform(0.2, 0.5)
        await driver.hold_stick(0.0, TURN, lambda: time.monotonic() > end_s)

    async def _stop_and_clear(self, driver: Driver) -> None:
        await driver.stop()
        await driver.until(lambda: driver.state and driver.state.stop.state == "stopped")
        await driver.clear()

    async def _stand(self, driver: Driver) -> None:
        await driver.drive(0.0, 0.0)
        await driver.until(lambda: driver.odometry and abs(driver.odometry.w) < STILL_RADPS)


@dataclass
class Rounds:
    """Round after round over one stack."""

    stack: Stack
    database: Database
    person: Person
    witness: Witness

    async def one(self, *victims: str) -> Counter[str]:
        """The session, the kill, the start; returns what reached the robot. Raises `LostError`."""
        before = counts(self.witness.received)
        killed_s = await self._until_killed(victims)
        everybody = "database" in victims and self.database.writers_too
        if "database" in victims:
            self.database.start(self.stack)
        if "web" in victims or everybody:
            self.stack.release(self.stack.web)
            self.stack.start_web()
        await asyncio.to_thread(self.stack.wait_ready, READY_S)
        await self._settled(killed_s if "bridge" in victims or everybody else 0.0)
        return counts(self.witness.received) - before

    async def _until_killed(self, victims: tuple[str, ...]) -> float:
        """Returns when, Unix time."""
        driver = await self.person.sit_down()
        session = asyncio.create_task(self.person.go_on(driver))
        try:
            await asyncio.wait([session], timeout=self.person.chance.uniform(EARLIEST_S, LATEST_S))
            if session.done():
                session.result()
                raise LostError("the session ended by itself")
            killed_s = time.time()
            self._kill(victims)
            await asyncio.wait([session], timeout=STILL_RUNS_S)
            return killed_s
        finally:
            session.cancel()
            await asyncio.gather(session, return_exceptions=True)
            with suppress(ConnectionClosed):
                await driver.__aexit__(None, None, None)

    def _kill(self, victims: tuple[str, ...]) -> None:
        """kill -9 of these, one right after the other."""
        for victim in victims:
            match victim:
                case "web":
                    self.stack.web.signal(signal.SIGKILL)
                case "bridge":
                    for bridge in bridges(self.stack):
                        os.kill(bridge, signal.SIGKILL)
                case "database":
                    self.database.kill(self.stack)

    async def _settled(self, before_s: float) -> None:
        """Everything that reached the robot is on record, the chains are whole, and what lacked its outcome has one."""
        end_s = time.monotonic() + SETTLED_S
        while True:
            log = await asyncio.to_thread(read_log, self.stack)
            left = unfinished(log.entries, before_s)
            if not left or time.monotonic() > end_s:
                break
        problems = [*log.findings, *unrecorded(self.witness.received, log.entries), *left]
        if problems:
            raise LostError("\n".join(problems))


def read_log(stack: Stack) -> Log:
    """The stack's audit log."""
    command = [sys.executable, "-m", "benchmarks.parts.audit.log_side"]
    told = subprocess.run(command, env=stack.environment, stdout=subprocess.PIPE, check=True)  # noqa: S603
    return msgspec.json.decode(told.stdout, type=Log)
