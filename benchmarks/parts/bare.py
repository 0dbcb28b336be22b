"""Delay of bare rospy or rclpy: one process publishes, another receives, without the console."""

from __future__ import annotations

import signal

from benchmarks.parts.observer import Observer, start_ros_side
from script.stack.stack import SimulatedRobot, Stack

SETTLED = 25  # messages after each pause that are not counted
PATIENCE_S = 60.0


class Bare:
    """Context: a publisher at 50 Hz that is paused between measurements. `observer` receives its messages."""

    def __init__(self, stack: Stack, robot: SimulatedRobot, observer: Observer) -> None:
        self._stack, self._observer = stack, observer
        self._publisher = start_ros_side(stack, robot, "publish")
        self._connected = False

    async def delays_s(self, count: int) -> list[float]:
        """Return the delays of `count` messages, in seconds; the publisher is paused before and after."""
        if self._connected:
            self._publisher.signal(signal.SIGCONT)
        self._connected = True
        self._observer.bare_s.clear()
        await self._observer.until(lambda: len(self._observer.bare_s) >= SETTLED + count, PATIENCE_S)
        self._publisher.signal(signal.SIGSTOP)
        return self._observer.bare_s[SETTLED : SETTLED + count]

    def __enter__(self) -> Bare:
        return self

    def __exit__(self, *_: object) -> None:
        self._publisher.signal(signal.SIGCONT)  # a stopped process would not get SIGTERM
        self._stack.release(self._publisher)
