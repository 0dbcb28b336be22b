"""A part of a robot: one capability over ROS. The node makes the parts when the robot has answered."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType
from typing import TypeVar

from robots.bridge.robot.interface import Node

log = logging.getLogger(__name__)
P = TypeVar("P")


class RobotPart:
    """A capability of the robot. Its class also says what it does, for example `MotionPlayer`."""

    @classmethod
    def of(cls, node: Node) -> RobotPart | None:
        """Return the part, connected; None: the robot's profile does not have it."""
        raise NotImplementedError

    @property
    def cancels(self) -> list[Callable[[], None]]:
        """For the emergency stop: each cancels all goals of one action, from any sender."""
        return []

    def surveyed(self) -> None:
        """Read missing data: the robot may start after its bridge."""


def kinds_in(folder: ModuleType) -> list[type[RobotPart]]:
    """Return the parts that a robot may have: every `RobotPart` that a module of this folder defines."""
    for module in iter_modules(folder.__path__, f"{folder.__name__}."):
        import_module(module.name)
    return [kind for kind in RobotPart.__subclasses__() if kind.__module__.startswith(f"{folder.__name__}.")]


class Parts:
    """The parts of one robot, of which some are there from the `first`."""

    def __init__(self, kinds: Sequence[type[RobotPart]], *first: object) -> None:
        self._kinds = kinds
        self._first = first
        self.connected: Sequence[RobotPart] = ()
        self._found: dict[type, object] = {}  # by what they do

    def connect(self, node: Node) -> None:
        """Make the parts that the robot's profile has."""
        self.connected = [part for kind in self._kinds if (part := kind.of(node))]

    def find(self, kind: type[P]) -> P | None:
        """Return the part that does this; None: the robot has none, or is not connected yet."""
        if kind not in self._found:
            found = next((part for part in (*self._first, *self.connected) if isinstance(part, kind)), None)
            if found is None:
                return None
            self._found[kind] = found
        return self._found[kind]  # type: ignore[return-value]

    def surveyed(self) -> None:
        """Let all parts read missing data."""
        for part in self.connected:
            part.surveyed()

    def cancel_all(self) -> None:
        """Cancel the goals of all clients, as an emergency stop must."""
        for cancel in [cancel for part in self.connected for cancel in part.cancels]:
            try:
                cancel()
            except Exception:  # its topic is being closed: the others are cancelled all the same
                log.exception("goals of one action were not cancelled")
