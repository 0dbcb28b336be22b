"""A recording of 20 MB/s of pictures and scans beside commands; the memory of the black box.

Commands are measured with and without the recording, in turn. The pictures are random bytes: nothing can compress them.
`FLEET_BENCH_SLOTS`, `FLEET_BENCH_SECONDS`: fewer slots, a shorter measurement of the processor time.
"""

from __future__ import annotations

import asyncio
import gc
import os
import re
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from multiprocessing import get_context
from uuid import uuid4

from websockets.asyncio.client import ClientConnection, unix_connect

from benchmarks.driving.drive import BARE_STICKS, ROBOT, SLOT, delays, drive
from benchmarks.harness import Figure, progress, quantile
from benchmarks.parts import process_stats
from benchmarks.parts.observer import Observer, start_ros_side
from benchmarks.parts.priority import prefer_loops_or_say
from robots.bridge.recorder.black_box.ring import Message, Origin, Ring
from robots.shared import wire
from script.stack.client import Driver, sign_in
from script.stack.stack import Stack, temporary_stack

PUBLISHERS = ("picture_20", "jpeg", "laser")
TOPICS = ["/bench_picture", "/bench_jpeg", "/bench_laser"]
SLOTS = 10
MEASURED_S = 20.0
SETTLED_S = 3.0
CORE_PERCENT = 25.0
P99_TIMES = 1.2
BOX_MB = 64.0
LEAST_MBPS = 18.0


def measure() -> list[Figure]:
    """Start a console with one robot, and record it."""
    with get_context("spawn").Pool(1) as process:
        figures = [Figure("black box, full: memory", process.apply(box_mb), "MB", BOX_MB)]
    with temporary_stack(BARE_STICKS[:1], settings={"FLEET_RECORDINGS": ""}) as stack:
        return figures + asyncio.run(measure_on(stack))


def box_mb() -> float:
    """Return the memory that a full ring takes in a process, in megabytes."""
    ring = Ring()
    scan = Origin("/scan", "ros1", "sensor_msgs/LaserScan", "", "", "/laser")
    before_mb = process_stats.resident_mb(os.getpid())
    for number in range(20_000):
        at_ns = number * 4_000_000
        ring.put(Message(scan, number, at_ns, os.urandom(2_700)))
        camera = Origin(f"/camera{number % 8}", "ros1", "sensor_msgs/CompressedImage", "", "", "/driver")
        ring.put(Message(camera, number, at_ns, os.urandom(60_000)))
    return process_stats.resident_mb(os.getpid()) - before_mb


async def measure_on(stack: Stack) -> list[Figure]:
    """Return all other figures."""
    gc.freeze()
    prefer_loops_or_say(stack)
    operator = await asyncio.to_thread(sign_in, stack, "operator")
    robot = stack.robots[ROBOT]
    alone_s: list[float] = []
    beside_s: list[float] = []
    publishers = [start_ros_side(stack, robot, role) for role in PUBLISHERS]
    async with Observer(robot) as observer, Driver(stack, ROBOT, operator) as driver:
        await driver.take()
        async with recorded(stack) as link:
            figures = await link.use()
        progress("commands with a recording, and without, in turn ...")
        for _ in range(int(os.environ.get("FLEET_BENCH_SLOTS", SLOTS))):
            alone_s += await drive(driver, observer, SLOT)
            async with recorded(stack):
                beside_s += await drive(driver, observer, SLOT)
    stack.release(*publishers)
    return [
        *figures,
        *delays("commands without", alone_s),
        *delays("commands beside a recording", beside_s),
        Figure(
            "commands beside a recording / without, p99",
            quantile(beside_s, 0.99) / quantile(alone_s, 0.99),
            "times",
            P99_TIMES,
        ),
    ]


@asynccontextmanager
async def recorded(stack: Stack) -> AsyncIterator[Link]:
    """Record the bench's topics within this context."""
    async with linked(stack) as link:
        await link.begin(TOPICS)
        try:
            yield link
        finally:
            await link.end_all()


@asynccontextmanager
async def linked(stack: Stack) -> AsyncIterator[Link]:
    """Context: a link to the bridge of the only robot."""
    [path] = [one for one in stack.run_directory.glob("*.sock") if re.fullmatch(r"[0-9a-f]{12}", one.stem)]
    async with unix_connect(str(path), max_size=None) as socket:
        link = Link(stack, socket)
        await link.say(wire.LinkHello(wire.PROTOCOL, "bench"))
        yield link


def recorders(stack: Stack) -> list[int]:
    """Return the process ids of the recorders."""
    return [
        child
        for bridge in process_stats.children(stack.supervisor.pid)
        for child in process_stats.children(bridge)
        if "robots.bridge.ros.recorder" in process_stats.arguments(child)
    ]


class Link:
    """A link to the bridge, which asks for recordings as a web process does."""

    def __init__(self, stack: Stack, socket: ClientConnection) -> None:
        self.recording = uuid4()
        self._stack = stack
        self._socket = socket
        self._seconds = float(os.environ.get("FLEET_BENCH_SECONDS", MEASURED_S))

    async def begin(self, topics: wire.RecordedTopics) -> None:
        """Begin a recording, and wait until it is written."""
        await self.say(wire.LinkRecord(self.recording, 600.0, topics, "bench", "", seq=1))
        await self._until(lambda state: state is not None and state.bytes > 0)

    async def end_all(self) -> None:
        """End the recording that goes on, if any; wait until the next one may begin."""
        state = await self._next()
        if state is not None:
            await self.say(wire.LinkRecordEnd(state.recording, seq=2))
            await self._until(lambda state: state is None)

    async def use(self) -> list[Figure]:
        """Measure the processor time of the recorder, and what reaches the file."""
        progress("the processor time of a recording ...")
        await asyncio.sleep(SETTLED_S)
        [pid] = recorders(self._stack)
        began_s, before_s, began = time.monotonic(), process_stats.cpu_s(pid), await self._state()
        await self._let_pass(self._seconds)
        spent_s = time.monotonic() - began_s
        used = 100.0 * (process_stats.cpu_s(pid) - before_s) / spent_s
        ended = await self._state()
        rate = (ended.bytes - began.bytes) / spent_s / 1e6
        return [
            Figure("recorder, 20 MB/s", used, "%", CORE_PERCENT),
            Figure("written", -rate, "MB/s", -LEAST_MBPS),
            Figure("dropped, and counted", ended.dropped, "messages"),
            Figure("recorder's memory", process_stats.resident_mb(pid), "MB"),
        ]

    async def say(self, message: wire.LinkRequest) -> None:
        """Send a request."""
        await self._socket.send(wire.encode(message).decode())

    async def _next(self) -> wire.RecordingState | None:
        while True:
            raw = await self._socket.recv()
            if isinstance(raw, str) and isinstance(report := wire.link_report(raw), wire.Status):
                return report.state.recording
            if isinstance(raw, str) and isinstance(report, wire.Refused):
                raise RuntimeError(report.refusal.text)

    async def _until(self, fits: Callable[[wire.RecordingState | None], bool]) -> None:
        async with asyncio.timeout(30.0):
            while not fits(await self._next()):
                pass

    async def _state(self) -> wire.RecordingState:
        while (state := await self._next()) is None:
            pass
        return state

    async def _let_pass(self, seconds: float) -> None:
        """Read the link all the while: its messages must not wait."""
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            await self._next()
