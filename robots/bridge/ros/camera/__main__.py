"""``python -m robots.bridge.ros.camera``: reads the bridge's config from the first line of stdin.

The process writes the address on which it listens as a JSON line, and repeats this line as a sign of life.
The bridge answers each line with the robot's clock. The
process ends when stdin ends or the robot's master dies. The bridge starts another process when it needs one.
"""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import msgspec

from robots.bridge.camera.camera_client import SILENCE_S
from robots.bridge.camera.picture_server import PictureServer
from robots.bridge.robot_clock import RobotClock
from robots.bridge.ros import child_node
from robots.bridge.ros.bounds.memory import limit_memory
from robots.bridge.ros.camera.producer import Producer
from robots.bridge.ros.vital import start_vital
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.processes.shutdown import exit_within
from robots.shared.ros.master import CAMERA

NICE = 3  # commands to the robot go first
MOST_BYTES = 1024 * 1024 * 1024  # of memory
END_S = 1.5  # until the process must have ended, after the end of stdin
LIFE_S = SILENCE_S / 5


async def serve(config: BridgeConfig) -> None:
    """Serve until stdin ends."""
    loop = asyncio.get_running_loop()
    server = PictureServer(
        config.link,
        set_wants=lambda wants: producer.set_wants(wants),
        require_key=lambda camera: producer.require_key(camera),
    )
    producer = Producer(
        config,
        emit=lambda *picture: _call(loop, server.show, *picture),
        state=lambda state: _call(loop, server.report, state),
    )
    start_vital(producer.run, "producer")
    showing = asyncio.create_task(_show_life(await server.start(), producer))
    await asyncio.to_thread(_follow_clock, producer)
    exit_within(END_S)
    showing.cancel()
    await server.close()


def _follow_clock(producer: Producer) -> None:
    """Read the robot's clock from the bridge's lines, until stdin ends."""
    for line in sys.stdin.buffer:
        producer.clock = msgspec.json.decode(line, type=RobotClock)


async def _show_life(at: wire.CameraAt, producer: Producer) -> None:
    """Write the address repeatedly while the producer works: the bridge ends a process that is silent."""
    while True:
        if time.monotonic() - producer.looked_s < LIFE_S:
            sys.stdout.buffer.write(wire.encode(at) + b"\n")
            sys.stdout.buffer.flush()
        await asyncio.sleep(LIFE_S)


def _call(loop: asyncio.AbstractEventLoop, work: Callable[..., None], *given: Any) -> None:
    with suppress(RuntimeError):  # the process ends
        loop.call_soon_threadsafe(work, *given)


def main() -> None:
    """Run until stdin ends."""
    logging.basicConfig(format="camera: %(message)s")
    logging.getLogger("robots").setLevel(logging.INFO)
    for number in (signal.SIGTERM, signal.SIGINT):  # the bridge handles them; its end closes our stdin
        signal.signal(number, signal.SIG_IGN)
    os.nice(NICE)
    limit_memory(MOST_BYTES)
    config = msgspec.json.decode(sys.stdin.buffer.readline(), type=BridgeConfig)
    child_node.join(config, CAMERA)
    asyncio.run(serve(config))
    child_node.leave()


if __name__ == "__main__":
    main()
