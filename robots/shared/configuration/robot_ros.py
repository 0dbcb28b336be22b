"""Which ROS a robot has, and how to reach it: plain values."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import ClassVar, Literal

from msgspec import Struct

RosVersion = Literal[1, 2]
Discovery = Literal["subnet", "localhost", "off"]


class Ros1(Struct, frozen=True, tag_field="version", tag=1):
    """ROS 1: the robot's own master."""

    side: ClassVar[str] = "robots.bridge.ros"  # the bridge's part that speaks it
    profile: ClassVar[str] = "ros1"  # of recordings, as MCAP calls it

    master_uri: str
    advertised_address: str | None = None  # the console's address on the robot's network (ROS_IP)
    host_aliases: dict[str, str] = {}  # robot host name -> address (libnss-wrapper)


class Ros2(Struct, frozen=True, tag_field="version", tag=2):
    """ROS 2: the domain in which the robot's nodes find each other."""

    side: ClassVar[str] = "robots.bridge.ros2"
    profile: ClassVar[str] = "ros2"

    domain_id: int = 0
    discovery: Discovery = "subnet"  # how far nodes are searched
    static_peers: tuple[str, ...] = ()  # addresses or host names that are asked besides
    discovery_server: str = ""  # host:port; then nothing is searched
    namespace: str = ""  # such as /tiago1: before topics that the configuration does not name, such as /tf
    setup: str = ""  # set-up script of an installed distribution; "": the console's own packages


Ros = Ros1 | Ros2


def ros1(ros: Ros) -> Ros1:
    """Return it for code that speaks ROS 1 only."""
    if not isinstance(ros, Ros1):
        raise TypeError("the robot has no ROS 1")
    return ros


def ros2(ros: Ros) -> Ros2:
    """Return it for code that speaks ROS 2 only."""
    if not isinstance(ros, Ros2):
        raise TypeError("the robot has no ROS 2")
    return ros


def side_command(ros: Ros, module: str) -> Sequence[str]:
    """Return the command that starts a process of the robot's side, such as "camera"."""
    return sys.executable, "-m", f"{ros.side}.{module}"
