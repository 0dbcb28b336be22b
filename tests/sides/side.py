"""The ROS of a robot under test: its network, its processes, its names of topics, actions and types."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import msgspec
import pytest
from msgspec.structs import replace

from robots.registry.shipped_profiles import profile_files
from robots.shared.configuration.bridge_config import BridgeConfig, Topics
from robots.shared.configuration.gate_profile import DepthView
from robots.shared.configuration.robot_ros import Ros, Ros1, Ros2
from robots.shared.messages.type_names import in_ros2
from robots.shared.ros2.environment import MESSAGES, WHEELS, domain_environment, ros_environment
from script.stack.processes import ReservedDomain
from tests.forked import ROS2, ForkedProgram
from tests.ros.bridge_support import robot_config
from tests.ros.support import Master
from tests.ros2.side import needs_rclpy

SIDES = [pytest.param("ros1"), pytest.param("ros2", marks=needs_rclpy)]
ALWAYS = ("drive", "odometry", "battery", "cancel_on_stop")  # beside laser and sonars, which are the same


class Side(ABC):
    """One robot's network, of one ROS."""

    name: ClassVar[str]
    number: ClassVar[int]
    profile: ClassVar[str]  # the shipped one of the simulated robot
    ros: Ros

    @abstractmethod
    def environment(self) -> dict[str, str]:
        """Return the environment of a process of this robot that is started by a command."""

    @abstractmethod
    def fork(self, program: str, *arguments: str, log: Path) -> ForkedProgram:
        """Start a program of this robot without importing its modules again."""

    @abstractmethod
    def address(self) -> dict[str, Any]:
        """Return how the robot is reached, as columns of the registry."""

    @property
    def topics(self) -> Topics:
        """The robot's topics and actions."""
        return _shipped(self.profile)

    def type(self, name: str) -> str:
        """Return the name that this ROS has for a type of messages of ROS 1, such as ``nav_msgs/Odometry``."""
        return name if self.number == 1 else in_ros2(name)

    def service_type(self, name: str) -> str:
        """Return the name that this ROS has for a type of services of ROS 1, such as ``std_srvs/SetBool``."""
        return name if self.number == 1 else name.replace("/", "/srv/")

    def parameter(self, node: str, name: str) -> str:
        """Return how people name a node's parameter, such as ``motions.wave.joints``."""
        return f"{node}/{name.replace('.', '/')}" if self.number == 1 else f"{node}:{name}"

    def config(
        self, folder: Path, *parts: str, topics: dict[str, Any] | None = None, **changes: Any
    ) -> BridgeConfig:
        """Return a TIAGo's configuration with these parts, such as "motions", and changes as of `robot_config`.

        Without parts it has drive topic, odometry, laser, sonars and battery.
        """
        plain = robot_config(folder, self.ros, **changes)
        chosen = {name: getattr(self.topics, name) for name in (*ALWAYS, *parts)} | (topics or {})
        found = replace(plain.topics, **chosen)
        view = DepthView(found.depth.height_m, found.depth.own_m) if found.depth else None
        gate = replace(plain.gate, has_arm=found.arm is not None, depth=view)
        return replace(plain, topics=found, gate=gate)


class Ros1Side(Side):
    name, number, profile = "ros1", 1, "tiago"

    def __init__(self, master: Master) -> None:
        self.master, self.ros = master, Ros1(master.uri, "127.0.0.1")

    def environment(self) -> dict[str, str]:
        return self.master.environment()

    def address(self) -> dict[str, Any]:
        return {"master_uri": self.master.uri, "advertised_address": "127.0.0.1"}

    def fork(self, program: str, *arguments: str, log: Path) -> ForkedProgram:
        return self.master.fork(program, *arguments, log=log)


class Ros2Side(Side):
    name, number, profile = "ros2", 2, "tiago-ros2"

    def __init__(self, domain: int) -> None:
        self.domain, self.ros = domain, Ros2(domain, "localhost")

    def address(self) -> dict[str, Any]:
        return {"domain_id": self.domain, "discovery": "localhost"}

    def environment(self) -> dict[str, str]:
        return os.environ | ros_environment([MESSAGES, WHEELS]) | domain_environment(self.domain)

    def fork(self, program: str, *arguments: str, log: Path) -> ForkedProgram:
        environment = domain_environment(self.domain)
        return ForkedProgram(program, *arguments, log=log, environment=environment, forks=ROS2)


@contextmanager
def running_side(name: str, folder: Path) -> Iterator[Side]:
    """A network of its own, with no robot yet: a rosmaster or a domain."""
    if name == "ros2":
        with closing(ReservedDomain()) as reserved:
            yield Ros2Side(reserved.number)
        return
    master = Master(folder).start()
    try:
        yield Ros1Side(master)
    finally:
        master.stop()


@cache
def _shipped(slug: str) -> Topics:
    file = next(file for file in profile_files() if file.slug == slug)
    return msgspec.convert({"drive": msgspec.to_builtins(file.drive), **file.topics}, Topics)
