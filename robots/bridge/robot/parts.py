"""A part of a robot: one capability over ROS. The node makes the parts when the robot has answered."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType

from robots.bridge.robot.interface import Node


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


def parts_of(node: Node, kinds: Sequence[type[RobotPart]]) -> list[RobotPart]:
    """Make the parts that the robot's profile has."""
    return [part for kind in kinds if (part := kind.of(node))]
