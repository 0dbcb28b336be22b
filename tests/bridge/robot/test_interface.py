"""Both ROS sides of a bridge have the members of the written interface, with the same parameters."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path

import pytest

from robots.bridge.robot.interface import RobotSide, StopSide
from tests.processes import REPOSITORY

SIDES = ["ros", "ros2"]
CLASSES = {RobotSide: ("node.py", "RosBase"), StopSide: ("watchdog.py", "WatchdogNode")}


def members(source: str, name: str) -> dict[str, str]:
    """Return the methods of a class, with the names and defaults of their parameters: mypy compares the types."""
    found = next(
        node for node in ast.parse(source).body if isinstance(node, ast.ClassDef) and node.name == name
    )
    methods = [node for node in found.body if isinstance(node, ast.FunctionDef)]
    for method in methods:
        for argument in [*method.args.args, *method.args.kwonlyargs]:
            argument.annotation = None
            argument.arg = argument.arg.lstrip("_")  # a side may not need it
    return {
        method.name: " ".join([*map(ast.unparse, method.decorator_list), ast.unparse(method.args)])
        for method in methods
    }


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("protocol", CLASSES)
def test_a_ros_side_fulfils_the_interface(side: str, protocol: type) -> None:
    wanted: dict[str, str] = {}
    for base in protocol.__mro__[:-3]:  # without Protocol, Generic and object
        wanted |= members(inspect.getsource(base), base.__name__)
    file, name = CLASSES[protocol]
    # Read, not imported: a process has one ROS only.
    found = members(Path(REPOSITORY, "robots", "bridge", side, file).read_text(), name)
    assert wanted and {member: found.get(member) for member in wanted} == wanted
