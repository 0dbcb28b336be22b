"""The topics that take a holder's input: connected by a side on a thread of their own, since that asks the robot."""

from __future__ import annotations

import time
from collections.abc import Callable

from robots.bridge.robot.incoming.reception import Reception
from robots.bridge.robot.worker import Worker
from robots.bridge.tasks.input_routing import InputSwitch
from robots.shared.wire import Use

Connect = Callable[[Use, frozenset[str]], None]


class Inputs(InputSwitch):
    """Velocities go to `drive`. `connect` connects to exactly these topics of a use, on the worker's thread."""

    def __init__(self, drive: str, reception: Reception, worker: Worker, connect: Connect) -> None:
        self.drive = drive
        self._reception = reception
        self._worker = worker
        self._connect = connect

    def attend(self, use: Use, topics: frozenset[str]) -> None:
        self._worker.do(lambda: self._attend(use, topics))

    def drive_to(self, topic: str) -> None:
        self.drive = topic

    def _attend(self, use: Use, topics: frozenset[str]) -> None:
        """Connect, and report the result in any case: `routing` counts the answers."""
        connected = None
        try:
            self._connect(use, topics)
            connected = topics
        finally:
            core = self._reception.core
            self._reception.post(lambda: core.tasks.routing.attended(use, connected, time.monotonic()))
