"""The inspector's process: reads the bridge's config from the first line of stdin, then requests.

Each message is one JSON line. This process ends when stdin ends or the robot is gone. The bridge starts another
one when it needs it, so this process never registers again.
"""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
from collections.abc import Callable

import msgspec

from robots.bridge.topics.inspector.requests import Inspector
from robots.bridge.topics.inspector.side import InspectorSide
from robots.bridge.topics.inspector_messages import Ready
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.processes.memory import limit_memory
from robots.shared.processes.shutdown import exit_within
from robots.shared.processes.vital import start_vital

NICE = 5  # commands to the robot go first
MOST_BYTES = 1536 * 1024 * 1024  # of memory: people view messages of tens of megabytes
END_S = 1.5  # until the process must have ended, after the end of stdin


class Lines:
    """Writes whole lines to stdout, from any thread; blocks while the reader does not read."""

    def __init__(self) -> None:
        self._lock = threading.Lock()

    def __call__(self, line: bytes) -> None:
        with self._lock:
            sys.stdout.buffer.write(line + b"\n")
            sys.stdout.buffer.flush()


def run(side: Callable[[BridgeConfig], InspectorSide]) -> None:
    """Run until stdin ends, with this side of the robot's ROS."""
    logging.basicConfig(format="inspector: %(message)s")
    logging.getLogger("robots").setLevel(logging.INFO)
    for number in (signal.SIGTERM, signal.SIGINT):  # the bridge handles them; its end closes our stdin
        signal.signal(number, signal.SIG_IGN)
    os.nice(NICE)
    limit_memory(MOST_BYTES)
    config = msgspec.json.decode(sys.stdin.buffer.readline(), type=BridgeConfig)
    say = Lines()
    inspector = Inspector(config, side(config), say)
    start_vital(inspector.run, "node")
    say(wire.encode(Ready()))
    for line in sys.stdin.buffer:
        inspector.handle_line(line)
    exit_within(END_S)
    inspector.close()
