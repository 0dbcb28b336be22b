"""A scripted control session during which processes between person and robot are killed (kill -9)."""

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
from typing import Any, Protocol

import msgspec
from websockets.exceptions import ConnectionClosed

from benchmarks.driving.stop import ROBOT, STILL_RADPS, TURN, bridges
from benchmarks.parts import process_stats
from benchmarks.soak.reconciliation import Log, Received, counts, unfinished, unrecorded
from robots.shared import wire
from script.stack.client import Driver
from script.stack.stack import Stack

PARTS = ("web", "bridge", "records", "database")
EARLIEST_S, LATEST_S = 0.5, 2.5  # time of the kill, after the start of a round's session
STILL_RUNS_S = 0.3  # the session continues after the kill, for the remaining processes
READY_S = 90.0  # a supervisor with a used-up restart budget pauses for a minute
SETTLED_S = 10.0
ANSWER_S = 20.0
OTHER_DRIVE_TOPIC = "/phone_vel"


class LostError(AssertionError):
    """A message reached the robot without a record, or the log is not correct."""


class Database(Protocol):
    """The database of a stack."""

    writers_too: bool  # `kill` also kills web process and bridge

    def kill(self, stack: Stack) -> None:
        """Kill the database with SIGKILL, in the middle of its writes."""

    def start(self, stack: Stack) -> None:
        """Start the processes that do not start themselves, except the web process."""


class Embedded:
    """SQLite, a part of the processes that write: all are killed at once, and the file must be intact."""

    writers_too = True

    def kill(self, stack: Stack) -> None:
        """Kill web and pages process, supervisor, bridge, records and housekeeping; then let SQLite check the file."""
        web, supervisor = stack.web.pid, stack.supervisor.pid
        for pid in (web, supervisor, *process_stats.children(web), *process_stats.children(supervisor)):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        with closing(sqlite3.connect(stack.directory / "fleet.sqlite3", timeout=10.0)) as database:
            findings = database.execute("PRAGMA integrity_check").fetchall()
        if findings != [("ok",)]:
            raise LostError(f"the database is damaged: {findings}")

    def start(self, stack: Stack) -> None:
        """Start the supervisor, which starts the others."""
        stack.release(stack.supervisor)
        stack.start_supervisor()


class Witness:
    """Async context: collects all messages that reach the robot."""

    def __init__(self, stack: Stack) -> None:
        self._stack = stack
        self._received: list[Received] = []
        self._goals: dict[str, Received] = {}
        self._ready = asyncio.Event()

    async def __aenter__(self) -> Witness:
        self._process = await asyncio.create_subprocess_exec(
            *("/usr/bin/setpriv", "--pdeathsig", "TERM"),
            *(sys.executable, "-m", "benchmarks.soak.witness_side"),
            env=self._stack.robots[ROBOT].environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        self._reader = asyncio.create_task(self._read())
        await asyncio.wait_for(self._ready.wait(), ANSWER_S)
        return self

    async def __aexit__(self, *_: object) -> None:
        if self._process.returncode is None:
            self._process.terminate()
        await self._process.wait()
        await self._reader

    @property
    def received(self) -> list[Received]:
        """Return all messages so far, each goal once."""
        return [*self._received, *self._goals.values()]

    @property
    def last_velocity_s(self) -> float:
        """Return the time of the last velocity, Unix time."""
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
    """A person at a control page who repeats all kinds of tasks, and continues after an interruption."""

    def __init__(self, stack: Stack, cookie: str, seed: int = 0) -> None:
        self._stack = stack
        self._cookie = cookie
        self.chance = random.Random(seed)  # noqa: S311 - for all random choices
        self._tab = secrets.token_urlsafe(24)
        self._numbers = count(1)
        steps: list[Callable[[Driver], Awaitable[Any]]] = [
            *(self._say, self._turn, self._publish, self._play, self._turn, self._say, self._choose),
            *(self._turn, self._publish, self._choose_default, self._stop_and_clear),
        ]
        self._steps = cycle(steps)

    async def sit_down(self) -> Driver:
        """Open the page, with control, without a stop, and with the stick in the middle."""
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
        """Carry out step after step, until cancelled or the connection is lost."""
        with suppress(ConnectionClosed):
            for step in self._steps:
                await step(driver)

    async def _say(self, driver: Driver) -> None:
        await driver.request_task(wire.Say(driver.fence or 1, f"Sentence {next(self._numbers)}.", "en-GB"))

    async def _publish(self, driver: Driver) -> None:
        fields = {"data": f"Note {next(self._numbers)}."}
        order = wire.Publish(driver.fence or 1, "/fleet_demo/notes", "std_msgs/String", fields)
        await driver.request_task(order)

    async def _play(self, driver: Driver) -> None:
        await self._stand(driver)
        await driver.request_task(wire.Play(driver.fence or 1, "open"))
        await driver.until(lambda: driver.state and not driver.state.motion)

    async def _choose(self, driver: Driver) -> None:
        await self._stand(driver)
        await driver.request_task(wire.Choose(driver.fence or 1, "drive", OTHER_DRIVE_TOPIC))

    async def _choose_default(self, driver: Driver) -> None:
        await self._stand(driver)
        await driver.request_task(wire.Choose(driver.fence or 1, "drive"))

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
    """Runs rounds on one stack."""

    stack: Stack
    database: Database
    person: Person
    witness: Witness

    async def one(self, *victims: str) -> Counter[str]:
        """Run a session, kill, start again.

        Return the number of messages to the robot by kind. Raises `LostError`.
        """
        before = counts(self.witness.received)
        killed_s = await self._until_killed(victims)
        everybody = "database" in victims and self.database.writers_too
        if "database" in victims:
            self.database.start(self.stack)
        if "web" in victims or everybody:
            self.stack.release(self.stack.web)
            self.stack.start_web()
        await asyncio.to_thread(self.stack.wait_ready, READY_S)
        # A records process may have committed a request of which the bridge does not know
        forgetful = everybody or not {"bridge", "records"}.isdisjoint(victims)
        await self._settled(killed_s if forgetful else 0.0)
        return counts(self.witness.received) - before

    async def _until_killed(self, victims: tuple[str, ...]) -> float:
        """Kill at a random time of a session. Return this time, Unix time."""
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
                await driver.__aexit__()

    def _kill(self, victims: tuple[str, ...]) -> None:
        """Kill these parts with SIGKILL, one after the other."""
        for victim in victims:
            match victim:
                case "web":
                    self.stack.web.signal(signal.SIGKILL)
                case "bridge":
                    for bridge in bridges(self.stack):
                        os.kill(bridge, signal.SIGKILL)
                case "records":
                    for child in process_stats.children(self.stack.supervisor.pid):
                        if "run_records" in process_stats.arguments(child):
                            os.kill(child, signal.SIGKILL)
                case "database":
                    self.database.kill(self.stack)

    async def _settled(self, before_s: float) -> None:
        """Check that messages to the robot have records, chains are intact, and requests have outcomes.

        Only requests older than `before_s` need an outcome. Raises `LostError`.
        """
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
    """Return the stack's audit log."""
    command = [sys.executable, "-m", "benchmarks.soak.log_side"]
    printed = subprocess.run(command, env=stack.environment, stdout=subprocess.PIPE, check=True)  # noqa: S603
    return msgspec.json.decode(printed.stdout, type=Log)
