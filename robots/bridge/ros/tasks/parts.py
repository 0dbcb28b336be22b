"""The parts that a robot may have: every `RobotPart` that a module of this folder defines."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pkgutil import iter_modules

from robots.bridge.ros import tasks
from robots.bridge.ros.tasks.robot_part import Node, RobotPart

for module in iter_modules(tasks.__path__, f"{tasks.__name__}."):
    import_module(module.name)


def parts_of(node: Node) -> Iterator[RobotPart]:
    """Make the parts that the robot's profile has."""
    return filter(None, (kind.of(node) for kind in RobotPart.__subclasses__()))
