"""Messages that come many times a second, read in a tenth of the time that their generated classes need.

rospy connects them to the publishers of the generated classes, whose type and checksum they have. A message that is too
short raises an exception, for which its publisher is cut off.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable

import nav_msgs.msg
import numpy as np
import sensor_msgs.msg

from robots.bridge.gate.sensing.depth import DepthImage
from robots.bridge.gate.values import LaserScan
from robots.shared.geometry.poses import Pose, Velocity
from robots.shared.geometry.quaternions import yaw_of
from robots.shared.texts import NAME, cut

_HEADER = struct.Struct("<4x3I")  # stamp in seconds and nanoseconds; length of the frame's name
_LENGTH = struct.Struct("<I")
_ODOMETRY = struct.Struct("<7d288x6d288x")  # pose, twist, and their covariances
_SCAN = struct.Struct("<7fI")  # angles, times and limits; number of ranges
_SIZE = struct.Struct("<3I")  # of a picture in pixels, and of the name of its encoding
_ROWS = struct.Struct("<BII")  # whether they are big-endian; bytes of a row, of the picture
_RANGE = np.dtype("<f4")


def _stamp(raw: bytes) -> tuple[float, int]:
    """Return the stamp (s) of a message, and where its header ends."""
    secs, nsecs, length = _HEADER.unpack_from(raw)
    return secs + nsecs / 1e9, _HEADER.size + length


class Odometry(nav_msgs.msg.Odometry):  # type: ignore[misc]
    """A nav_msgs/Odometry in the plane: `stamp_s`, `planar_pose` and `velocity`."""

    def __init__(self) -> None:
        """Read nothing yet."""

    def deserialize(self, raw: bytes) -> Odometry:
        self.stamp_s, at = _stamp(raw)
        (length,) = _LENGTH.unpack_from(raw, at)
        x, y, _, *turn, vx, vy, _, _, _, w = _ODOMETRY.unpack_from(raw, at + _LENGTH.size + length)
        self.planar_pose, self.velocity = Pose(x, y, yaw_of(*turn)), Velocity(vx, vy, w)
        return self


class Scan(sensor_msgs.msg.LaserScan):  # type: ignore[misc]
    """A sensor_msgs/LaserScan: `scan`, of which source and arrival are not known yet."""

    def __init__(self) -> None:
        """Read nothing yet."""

    def deserialize(self, raw: bytes) -> Scan:
        stamp_s, at = _stamp(raw)
        first, _, step, _, _, nearest_m, farthest_m, beams = _SCAN.unpack_from(raw, at)
        ranges = np.frombuffer(raw, _RANGE, beams, at + _SCAN.size)
        self.scan = LaserScan("", stamp_s, -math.inf, ranges, first, step, nearest_m, farthest_m)
        return self


def depth_image(raw: bytes) -> tuple[float, str, DepthImage]:
    """Return stamp, frame and picture of a sensor_msgs/Image, whose bytes are not copied."""
    stamp_s, at = _stamp(raw)
    frame = raw[_HEADER.size : at].decode(errors="replace")
    height, width, length = _SIZE.unpack_from(raw, at)
    at += _SIZE.size
    encoding = raw[at : at + length].decode(errors="replace")
    big_endian, step, size = _ROWS.unpack_from(raw, at + length)
    at += length + _ROWS.size
    data = memoryview(raw)[at : at + size]
    return stamp_s, frame, DepthImage(width, height, encoding, bool(big_endian), step, data)


BRIEF: dict[str, type[Odometry] | type[Scan]] = {kind._type: kind for kind in (Odometry, Scan)}  # by type


class JointStates:
    """Reads sensor_msgs/JointState. Names are decoded only when they differ from those of the message before."""

    def __init__(self) -> None:
        self._known: tuple[bytes, list[str]] = _LENGTH.pack(0), []  # names, raw and decoded

    def positions(self, raw: bytes) -> Iterable[tuple[str, float]]:
        """Return the positions of the joints (rad or m). Thread-safe."""
        _, at = _stamp(raw)
        known, names = self._known
        if not raw.startswith(known, at):
            names, end = _names(raw, at)
            known = raw[at:end]
            self._known = known, names
        at += len(known)
        (count,) = _LENGTH.unpack_from(raw, at)
        return zip(names, struct.unpack_from(f"<{count}d", raw, at + _LENGTH.size), strict=False)


def _names(raw: bytes, at: int) -> tuple[list[str], int]:
    """Return the list of texts at this place of a message, cut, and where it ends."""
    (count,) = _LENGTH.unpack_from(raw, at)
    at += _LENGTH.size
    names = []
    for _ in range(count):
        (length,) = _LENGTH.unpack_from(raw, at)
        at += _LENGTH.size
        names.append(cut(raw[at : at + length].decode(errors="replace"), NAME))
        at += length
    return names, at
