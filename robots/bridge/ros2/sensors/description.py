"""The robot's description (URDF), which its robot_state_publisher publishes once and keeps."""

from __future__ import annotations

from typing import Any

from robots.bridge.ros2.followed import FollowedTopics
from robots.bridge.ros2.qos import kept
from robots.bridge.ros2.sensors.cdr import Cdr
from robots.shared.texts import DESCRIPTION
from robots.shared.unreachable import Unreachable


class DescriptionTopic:
    """The topic. `text` is None until the description has come."""

    def __init__(self, followed: FollowedTopics, topic: str) -> None:
        self._name = topic
        self.text: str | None = None
        self._topic = followed.listen(topic, "std_msgs/msg/String", self._take, kept)

    def read(self) -> str | None:
        """Return the description; None: nobody publishes one. Raises `Unreachable` until it has come."""
        self._topic.follow()
        if self.text is None and self._topic.publishers:
            raise Unreachable(self._name)
        return self.text

    def _take(self, raw: bytes, _info: Any) -> None:
        message = Cdr(raw)
        length = message.number()
        text = bytes(message.data(length)[: length - 1]).decode(errors="replace")[:DESCRIPTION]
        if text != self.text:
            self.text = text
