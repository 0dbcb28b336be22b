"""The main part of a process beside the bridge that serves web processes: camera process, tap and shelf.

It reads the bridge's config from the first line of stdin, writes the address on which it listens as a JSON line, and
repeats this line as a sign of life. The bridge answers each line with the robot's clock. The process ends when stdin
ends or, if it has a node, the robot is gone. The bridge starts another process when it needs one.
"""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, suppress
from typing import Any, Protocol

import msgspec

from robots.bridge.robot_clock import RobotClock
from robots.bridge.served.client import SILENCE_S
from robots.bridge.served.server import ProcessServer
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.processes.memory import limit_memory
from robots.shared.processes.shutdown import exit_within

END_S = 1.5  # until the process must have ended, after the end of stdin
LIFE_S = SILENCE_S / 5


class Serving(Protocol):
    """The work of such a process. `looked_s`: a recent time (s, monotonic) shows that its thread works."""

    clock: RobotClock  # the robot's, as the bridge knows it

    @property
    def server(self) -> ProcessServer[Any]: ...

    @property
    def looked_s(self) -> float: ...


Call = Callable[..., None]  # calls its first argument on the event loop, with the others; from any thread
Begin = Callable[[BridgeConfig, Call], Serving]
Joined = Callable[[BridgeConfig], AbstractContextManager[object]]


def run(name: str, nice: int, most_bytes: int, begin: Begin, joined: Joined = nullcontext) -> None:
    """Run until stdin ends. `nice`: commands to the robot go first. `joined`: context of the robot's network."""
    logging.basicConfig(format=f"{name}: %(message)s")
    logging.getLogger("robots").setLevel(logging.INFO)
    for number in (signal.SIGTERM, signal.SIGINT):  # the bridge handles them; its end closes our stdin
        signal.signal(number, signal.SIG_IGN)
    os.nice(nice)
    limit_memory(most_bytes)
    config = msgspec.json.decode(sys.stdin.buffer.readline(), type=BridgeConfig)
    with joined(config):
        asyncio.run(_serve(config, begin))


async def _serve(config: BridgeConfig, begin: Begin) -> None:
    loop = asyncio.get_running_loop()

    def call(work: Callable[..., None], *given: Any) -> None:
        with suppress(RuntimeError):  # the process ends
            loop.call_soon_threadsafe(work, *given)

    serving = begin(config, call)
    showing = asyncio.create_task(_show_life(await serving.server.start(), serving))
    await asyncio.to_thread(_follow_clock, serving)
    exit_within(END_S)
    showing.cancel()
    await serving.server.close()


def _follow_clock(serving: Serving) -> None:
    """Read the robot's clock from the bridge's lines, until stdin ends."""
    for line in sys.stdin.buffer:
        serving.clock = msgspec.json.decode(line, type=RobotClock)


async def _show_life(at: wire.ProcessAt, serving: Serving) -> None:
    """Write the address repeatedly while the process works: the bridge ends a process that is silent."""
    while True:
        if time.monotonic() - serving.looked_s < LIFE_S:
            sys.stdout.buffer.write(wire.encode(at) + b"\n")
            sys.stdout.buffer.flush()
        await asyncio.sleep(LIFE_S)
