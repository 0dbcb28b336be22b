"""Messages of bridge and watchdog on the drive topic."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from robots.shared.processes.probe_findings import BRIDGE
from tests.messages import Messages
from tests.processes import until


class Zeros:
    """Messages on the drive topic, by publisher."""

    def __init__(
        self, inbox: Messages, watchdog: str, by: Callable[[Any], str] = lambda message: message.by
    ) -> None:
        """`by` returns the node that sent a message."""
        self._inbox, self._watchdog, self._by = inbox, watchdog, by

    def of_the_watchdog(self, count: int = 5) -> None:
        """Wait for this number of new zeros from the watchdog."""
        self._inbox.drain()
        for _ in range(count):
            self._inbox.until(lambda message: self._by(message) == self._watchdog and _still(message))

    def end(self) -> None:
        """Wait until the watchdog has published nothing for 0.5 s."""

        def quiet() -> bool:
            time.sleep(0.5)
            return not any(self._by(message) == self._watchdog for message in self._inbox.drain())

        self._inbox.drain()
        until(quiet, "the watchdog to be quiet")

    def none_but_zeros(self) -> bool:
        """Return whether bridge and watchdog have published only zeros."""
        ours = (BRIDGE, self._watchdog)
        return all(_still(message) for message in self._inbox.drain() if self._by(message) in ours)


def _still(twist: Any) -> bool:
    return bool(twist.linear.x == twist.linear.y == twist.angular.z == 0.0)
