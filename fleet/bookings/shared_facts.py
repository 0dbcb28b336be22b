"""Run the booking requests of one process one after another.

A waiting request may use facts that another request has read since the waiting one arrived.

Else, if fifty people want one slot, all would find it free, wait for the database's lock, and only then be
refused.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from uuid import UUID

from django.dispatch import receiver

from fleet.bookings.rules import Slot
from fleet.bookings.selectors import RobotFacts, robot_facts
from fleet.bookings.services import changed
from robots.registry.models import Robot

TURN_S = 1.0

_turn = threading.Lock()
_newest: tuple[UUID, Slot, float, RobotFacts] | None = None  # the float: monotonic time before the reading, s


@contextmanager
def in_turn() -> Iterator[Callable[[Robot, Slot], RobotFacts]]:
    """Let one request of this process book at a time. A request waits at most `TURN_S`, then it books anyway.

    Yield a function that returns a robot's facts, no older than this call. Use them only to refuse early, not
    to decide under the lock.
    """
    came_s = time.monotonic()

    def read(robot: Robot, slot: Slot) -> RobotFacts:
        global _newest
        newest = _newest  # another thread may change it at any time
        if newest is not None and newest[:2] == (robot.id, slot) and newest[2] >= came_s:
            return newest[3]
        read_s = time.monotonic()
        facts = robot_facts(robot, slot)
        _newest = (robot.id, slot, read_s, facts)
        return facts

    mine = _turn.acquire(timeout=TURN_S)
    try:
        yield read
    finally:
        if mine:
            _turn.release()


@receiver(changed)
def _forget(**_options: Any) -> None:
    """Forget the facts after a booking: with the old facts, the next request would find the slot free."""
    global _newest
    _newest = None
