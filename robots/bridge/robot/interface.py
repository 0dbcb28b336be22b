"""Each ROS side of a bridge, as the rest sees it: `robots.bridge.ros` and `robots.bridge.ros2` fulfil these protocols.

A test compares their signatures; mypy compares each side where it is defined.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Protocol

from robots.bridge.arm.posture import ArmPosture
from robots.bridge.core import Core
from robots.bridge.robot.incoming.mailboxes import Mailboxes
from robots.bridge.robot_reports import Base
from robots.bridge.tasks.holder_tasks import HolderTasks
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.geometry.poses import Pose

Call = Callable[[], None]


class RobotSide(Base, Protocol):
    """A robot's ROS interface for the bridge's process and core. It passes the robot's data to the event loop."""

    mail: Mailboxes
    watched: bool  # somebody looks at views

    def start(
        self,
        loop: asyncio.AbstractEventLoop,
        core: Core,
        run_on_loop: Callable[[Call], None],
        on_lost: Callable[[bool], None],
    ) -> None:
        """Start the search for the robot. After `on_lost`, only a new process can be this robot's bridge.

        `on_lost` gets True if another bridge took the name. `run_on_loop` runs calls with the robot's data on the
        loop.
        """

    def stop(self) -> None:
        """Publish zero and leave the robot."""

    def hurry(self, wanted: bool) -> None:
        """Read sensors at once, and each message, until that is no longer wanted."""

    def use_on_demand_topics(self, wanted: bool) -> None:
        """Subscribe to the costly topics (depth, tf) only while a person drives."""

    def joints(self, now_s: float) -> dict[str, float]:
        """Return the positions (rad or m) of joints of the robot's description, as far as they are known."""

    def map_to_odom(self) -> Pose | None:
        """Return the odometry frame in the map frame, if the robot has a map and a person drives."""


class StopSide(Protocol):
    """A robot's ROS interface for its watchdog: it only publishes, so that no message of the robot can delay it."""

    def start(self) -> None:
        """Search for the robot on a separate thread."""

    def stop(self) -> None:
        """Leave the robot."""

    def zero(self) -> int:
        """Publish a zero velocity on every drive topic; returns the number of nodes that it was written to."""

    def cancel(self) -> None:
        """Cancel the goals of all clients."""

    def drive_to(self, topic: str) -> None:
        """Publish zeros on this topic from now on, in addition to the default topic. Returns at once."""


class RobotParameters(Protocol):
    """A robot's answers. Calls take a while, and raise `Unreachable`."""

    def motions(self, action: str, motion: str = "") -> Any:
        """Return the parameters of an action's motions, by name, or those of one motion; None: there are none."""

    def listed_motions(self, action: str) -> dict[str, float] | None:
        """Return names and durations (s) of the motions that the action's server lists; None without an answer."""


class Node(Protocol):
    """A ROS side, as its parts use it."""

    config: BridgeConfig
    parameters: RobotParameters
    mail: Mailboxes
    posture: ArmPosture | None  # None: the robot reports no joint states

    @property
    def tasks(self) -> HolderTasks:
        """The tasks of the holder. Use them on the event loop only."""

    def post(self, call: Call) -> None:
        """Run a call on the event loop."""

    def joint(self, name: str) -> float | None:
        """Return the position of a joint (rad or m); None if it was not reported lately."""

    def located(self) -> tuple[float, Pose] | None:
        """Return the newest transform from map to odometry and its stamp, if a person drives."""

    def find_listener(self, topic: str) -> None:
        """Ask the robot again who listens, if nobody listened to this topic at the last survey."""
