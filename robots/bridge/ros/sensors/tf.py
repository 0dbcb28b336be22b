"""The topics /tf and /tf_static: poses of the robot's frames."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator

import rospy

from robots.bridge.robot.sensors.frames import MAP, ODOM, TRANSFORM, FramePose, Frames
from robots.bridge.ros.sensors.raw_bytes import listen
from robots.shared.geometry.poses import Pose

_HEADER = struct.Struct("<III")  # number, seconds, nanoseconds
_LENGTH = struct.Struct("<I")


class TfTopics:
    """Poses of frames in `base`, and of the odometry frame in the map frame."""

    def __init__(self, base: str = MAP) -> None:
        self.frames = Frames(base)

    def listen(self) -> list[rospy.Subscriber]:
        """Subscribe."""
        topics = {"/tf_static": True, "/tf": False}
        return [listen(name, "tf2_msgs/TFMessage", self._taking(fixed)) for name, fixed in topics.items()]

    def _taking(self, fixed: bool) -> Callable[[bytes], None]:
        return lambda raw: self.frames.take(transforms(raw), fixed)

    def forget(self) -> None:
        """Forget all transforms: they may be outdated."""
        self.frames.forget()

    def located(self) -> tuple[float, Pose] | None:
        """Return the stamp and the last pose of the odometry frame in the map frame, if any."""
        return self.frames.flat(ODOM, MAP)


def transforms(raw: bytes) -> Iterator[tuple[str, FramePose]]:
    """Yield child frame and pose of a serialized tf2_msgs/TFMessage: the complete ones if it is cut."""
    try:
        (count,) = _LENGTH.unpack_from(raw)
        at = _LENGTH.size
        for _ in range(count):
            _, seconds, nanoseconds = _HEADER.unpack_from(raw, at)
            parent, at = _name(raw, at + _HEADER.size)
            child, at = _name(raw, at)
            packed = raw[at : at + TRANSFORM.size]
            at += TRANSFORM.size
            if len(packed) < TRANSFORM.size:
                return
            yield child, FramePose(seconds + nanoseconds / 1e9, parent, packed)
    except struct.error:
        return


def _name(raw: bytes, at: int) -> tuple[str, int]:
    """Return a frame's name and the offset of the next field. Old publishers write a slash before the name."""
    (length,) = _LENGTH.unpack_from(raw, at)
    begin = at + _LENGTH.size
    return raw[begin : begin + length].decode(errors="replace").lstrip("/"), begin + length
