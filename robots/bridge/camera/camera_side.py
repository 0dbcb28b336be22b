"""A ROS side's work for the camera process: it subscribes to cameras, and reads their messages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from robots.bridge.camera.lens import CameraInfo
from robots.bridge.robot.sensors.frames import Frames
from robots.shared.configuration.bridge_config import CameraSource


class Unreadable(Exception):
    """A message that is not of its type, or is cut."""


class Taken(NamedTuple):
    """A message with a picture, after its bytes were read."""

    stamp_s: float
    frame: str
    message: Any  # with the fields of sensor_msgs/CompressedImage or sensor_msgs/Image


class Subscription(Protocol):
    """A camera's topics while somebody watches it."""

    @property
    def publishers(self) -> int:
        """The number of nodes that send pictures."""

    def close(self) -> None:
        """Unsubscribe."""


class CameraSide(Protocol):
    """The cameras of one robot."""

    frames: Frames  # by tf, which is read from the begin

    def listen(
        self,
        source: CameraSource,
        picture: Callable[[Any], None],
        info: Callable[[bytes], None],
        knows_info: Callable[[], bool],
    ) -> Subscription:
        """Subscribe. On the side's threads, `picture` gets each message, `info` the bytes of each camera info.

        If `knows_info` returns true, camera infos may come seldom.
        """

    def type_of(self, message: Any) -> str:
        """Return the type of a message as its publisher names it; "*" if it does not."""

    def read(self, message: Any) -> Taken:
        """Read the message of a picture. Raises Unreadable."""

    def read_info(self, raw: bytes) -> CameraInfo:
        """Read a camera info. Raises Unreadable."""
