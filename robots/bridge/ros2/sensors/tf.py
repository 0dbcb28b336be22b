"""The topics /tf and /tf_static: poses of the robot's frames."""

from __future__ import annotations

from collections.abc import Iterator

from robots.bridge.robot.sensors.frames import MAP, ODOM, TRANSFORM, FramePose, Frames
from robots.bridge.ros2.participant import Participant, Subscription, Take
from robots.bridge.ros2.qos import STATIC, sensor
from robots.bridge.ros2.sensors.cdr import Cdr
from robots.shared.geometry.poses import Pose

WAIT = 100  # messages: a robot publishes fifty a second


class TfTopics:
    """Poses of frames in `base`, and of the odometry frame in the map frame."""

    def __init__(self, participant: Participant, namespace: str, base: str = MAP) -> None:
        self.frames = Frames(base)
        self._participant, self._namespace = participant, namespace

    def listen(self) -> list[Subscription]:
        """Subscribe."""
        topics = {"/tf_static": STATIC, "/tf": sensor(WAIT)}
        return [
            self._participant.listen(
                f"{self._namespace}{name}", "tf2_msgs/msg/TFMessage", self._taking(fixed=qos is STATIC), qos
            )
            for name, qos in topics.items()
        ]

    def _taking(self, fixed: bool) -> Take:
        return lambda raw, _info: self.frames.take(transforms(raw), fixed)

    def forget(self) -> None:
        """Forget all transforms: they may be outdated."""
        self.frames.forget()

    def located(self) -> tuple[float, Pose] | None:
        """Return the stamp and the last pose of the odometry frame in the map frame, if any."""
        return self.frames.flat(ODOM, MAP)


def transforms(raw: bytes) -> Iterator[tuple[str, FramePose]]:
    """Yield child frame and pose of a tf2_msgs/msg/TFMessage: the complete ones if it is cut."""
    message = Cdr(raw)
    try:
        for _ in range(message.number()):
            stamp_s, parent = message.header()
            child = message.text().lstrip("/")
            yield child, FramePose(stamp_s, parent, TRANSFORM.pack(*message.values("7d", 8)))
    except ValueError:
        return
