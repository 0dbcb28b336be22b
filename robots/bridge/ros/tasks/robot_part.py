"""A part of a robot: one capability over ROS. The node makes the parts when the robot's master has answered."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from robots.bridge.arm.posture import ArmPosture
from robots.bridge.robot.mailboxes import Mailboxes
from robots.bridge.tasks.holder_tasks import HolderTasks
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.geometry.poses import Pose
from robots.shared.ros.master import Master


class Node(Protocol):
    """The node, as its parts use it."""

    config: BridgeConfig
    master: Master
    mail: Mailboxes
    posture: ArmPosture | None  # None: the robot reports no joint states

    @property
    def tasks(self) -> HolderTasks:
        """The tasks of the holder. Use them on the event loop only."""

    def post(self, call: Callable[[], None]) -> None:
        """Run a call on the event loop."""

    def joint(self, name: str) -> float | None:
        """Return the position of a joint (rad or m); None if it was not reported lately."""

    def located(self) -> tuple[float, Pose] | None:
        """Return the newest transform from map to odometry and its stamp, if a person drives."""

    def find_listener(self, topic: str) -> None:
        """Ask the master again who listens, if nobody listened to this topic at the last survey."""


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
        """Read missing data: the robot may start after its master."""
