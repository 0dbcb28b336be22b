"""``python -m robots.bridge.ros.camera``: reads the bridge's config from the first line of stdin.

It writes the address on which it listens as one JSON line, and ends when stdin ends or the robot's master dies. The
bridge starts another one when it needs it.
"""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import msgspec

from robots import wire
from robots.bridge.camera.picture_server import PictureServer
from robots.bridge.config import BridgeConfig
from robots.bridge.ros import child_node
from robots.bridge.ros.bounds.memory import limit_memory
from robots.bridge.ros.camera.producer import Producer
from robots.bridge.ros.network.master import CAMERA
from robots.bridge.ros.vital import start_vital
from robots.processes.shutdown import exit_within

NICE = 3  # commands to the robot go first
MOST_BYTES = 1024 * 1024 * 1024  # of memory
END_S = 1.5  # from the end of stdin


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
    sys.stdout.buffer.write(wire.encode(await server.start()) + b"\n")
    sys.stdout.buffer.flush()
    await asyncio.to_thread(sys.stdin.buffer.read)
    exit_within(END_S)
    await server.close()


def _call(loop: asyncio.AbstractEventLoop, work: Callable[..., None], *given: Any) -> None:
    """Do this on the loop."""
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
