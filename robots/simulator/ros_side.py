"""The parts of ROS that simulated topics and actions need. `ros.side` fulfils it with rospy, `ros2.side` with rclpy.

Types of messages and actions have their bare names, such as ``geometry_msgs/Twist`` and ``control_msgs/PointHead``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Protocol

Stamp = int  # nanoseconds of the robot's clock
NANO = 1_000_000_000  # of them in a second


class Publisher(Protocol):
    """Publishes to one topic."""

    @property
    def wanted(self) -> bool:
        """Whether somebody listens."""

    def publish(self, message: Any) -> None:
        """Publish a message, from any thread."""


class Goal(Protocol):
    """A goal of an action. `fields` are those of its result or feedback; ROS 2 has no texts of ends."""

    @property
    def request(self) -> Any:
        """The goal's message."""

    def accept(self) -> None:
        """Begin it."""

    def reject(self, text: str, /, **fields: Any) -> None:
        """Refuse to begin it."""

    def ignore(self) -> None:
        """Never answer, as a fault."""

    def succeed(self, text: str = "", /, **fields: Any) -> None:
        """End it with success."""

    def abort(self, text: str, /, **fields: Any) -> None:
        """End it without success."""

    def cancel(self, text: str, /, **fields: Any) -> None:
        """End it because somebody cancelled it, or another goal replaced it."""

    def feedback(self, **fields: Any) -> None:
        """Tell how far it is."""


class Goals(Protocol):
    """Goals and cancels of one action, passed from ROS's threads to the robot's thread."""

    def arrived(self) -> Iterator[tuple[bool, Goal]]:
        """Yield the messages since the last call, in order: (True, new goal) or (False, goal to cancel)."""


class RosSide(Protocol):
    """This robot's ROS."""

    def publisher(
        self, topic: str, kind: str, *, queue: int = 1, kept: bool = False, sensor: bool = False
    ) -> Publisher:
        """Advertise a topic. `kept`: later listeners get the last message; `sensor`: lost messages are not repeated."""

    def subscribe(
        self, topic: str, kind: str, take: Callable[[Any], None], *, queue: int | None = None
    ) -> None:
        """Call `take` with each message, on one of ROS's threads."""

    def goals(self, action: str, kind: str) -> Goals:
        """Serve an action."""

    def now(self) -> Stamp:
        """Return the time of the robot's clock."""

    def new(self, kind: str, **fields: Any) -> Any:
        """Return a new message."""

    def stamped(self, message: Any, stamp: Stamp, frame: str = "") -> Any:
        """Set the time and frame of a message; return the message."""

    def calibrated(self, info: Any, **matrices: list[float]) -> Any:
        """Set matrices of a sensor_msgs/CameraInfo by their small letters; return it."""

    def seconds(self, duration: Any) -> float:
        """Return the seconds of a duration in a message."""

    def octets(self, data: bytes) -> Any:
        """Return the value of a field uint8[]."""

    def octet(self, value: int) -> Any:
        """Return the value of a field byte."""
