"""Keeps out of bridge and watchdog what rospy and its parts import and they never use: one of each runs for each robot.

All of it is optional to who imports it: of roslib rospy asks only whether a shell uses it, which it is told; pydoc
describes methods of XML-RPC on a page that nobody opens, minidom reads manifests of packages, the names of HTML's
entities are read nowhere; without numpy genpy knows no numpy numbers. `robots.bridge.robot.lean` leaves out more.
Packages of messages import all their classes; here they import each one when it is asked for.
"""

from __future__ import annotations

import sys
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any

import robots.shared.ros  # noqa: F401  (makes ROS importable)
from robots.bridge.robot.lean import leave_out

EMPTY = ("html.entities", "pydoc", "roslib", "xml.dom", "xml.dom.minidom")
MESSAGES = (
    "actionlib_msgs",
    "diagnostic_msgs",
    "geometry_msgs",
    "move_base_msgs",
    "nav_msgs",
    "rosgraph_msgs",
    "sensor_msgs",
    "std_msgs",
    "tf2_msgs",
    "trajectory_msgs",
)


def lighten_watchdog() -> None:
    """Leave out what a watchdog does not need. Call this before anything imports rospy."""
    lighten()
    leave_out("numpy")


def lighten() -> None:
    """Leave out what neither process needs. Call this before anything imports rospy."""
    sys.modules |= {name: ModuleType(name) for name in EMPTY}
    sys.modules["pydoc"].HTMLDoc = object  # type: ignore[attr-defined]  # the base of a class
    sys.modules["html.entities"].html5 = {}  # type: ignore[attr-defined]
    for package in MESSAGES:
        with suppress(ModuleNotFoundError):  # not all robots need all of them
            sys.modules[f"{package}.msg"] = import_module(package).msg = _Messages(package)  # type: ignore[attr-defined]


class _Messages(ModuleType):
    """A package's messages."""

    def __init__(self, package: str) -> None:
        super().__init__(f"{package}.msg")
        found = find_spec(self.__name__)
        self.__path__ = (found and found.submodule_search_locations) or []

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            module = import_module(f"{self.__name__}._{name}")
        except ModuleNotFoundError as error:
            raise AttributeError(f"{self.__name__} has no {name}") from error
        setattr(self, name, found := getattr(module, name))
        return found
