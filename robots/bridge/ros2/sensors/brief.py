"""Messages that come many times a second, read from their bytes (CDR): generated classes need ten times as long.

A message that is too short, or in a form that no ROS 2 publishes, raises ValueError.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np

from robots.bridge.gate.values import LaserScan
from robots.shared.geometry.poses import Pose, Velocity
from robots.shared.geometry.quaternions import yaw_of

ENCAPSULATION = 4  # bytes before the message; alignment counts from their end
ORDERS = {b"\0\0": ">", b"\0\1": "<"}  # by the first two of them: CDR, big-endian or little-endian


class Odometry(NamedTuple):
    """A nav_msgs/msg/Odometry in the plane."""

    stamp_s: float
    pose: Pose
    velocity: Velocity


class Cdr:
    """Reads a message from its begin."""

    def __init__(self, raw: bytes) -> None:
        order = ORDERS.get(raw[:2])
        if order is None:
            raise ValueError("the message is not in CDR")
        self._raw = memoryview(raw)[ENCAPSULATION:]
        self.order = order
        self._at = 0

    def values(self, form: str, size: int) -> tuple[float, ...]:
        """Return numbers of `size` bytes each, of this form."""
        self._at += -self._at % size
        try:
            found = struct.unpack_from(self.order + form, self._raw, self._at)
        except struct.error as error:
            raise ValueError("the message is too short") from error
        self._at += struct.calcsize(self.order + form)
        return found

    def skip_text(self) -> None:
        """Pass a string; its length includes a zero at its end."""
        (length,) = self.values("I", 4)
        self._at += int(length)

    def stamp_s(self) -> float:
        """Return the stamp (s) of a std_msgs/msg/Header, and pass the header."""
        seconds, nanoseconds = self.values("iI", 4)
        self.skip_text()
        return seconds + nanoseconds / 1e9

    def floats(self) -> np.ndarray[tuple[int], np.dtype[np.float32]]:
        """Return a sequence of 32-bit numbers, which are not copied."""
        (count,) = self.values("I", 4)
        return np.frombuffer(self._raw, f"{self.order}f4", int(count), self._at)


def odometry(raw: bytes) -> Odometry:
    """Read a nav_msgs/msg/Odometry."""
    message = Cdr(raw)
    stamp_s = message.stamp_s()
    message.skip_text()
    x, y, _, *turn, vx, vy, _, _, _, w = message.values("7d288x6d", 8)
    return Odometry(stamp_s, Pose(x, y, yaw_of(*turn)), Velocity(vx, vy, w))


def scan(raw: bytes, source: str, arrival_s: float) -> LaserScan:
    """Read a sensor_msgs/msg/LaserScan."""
    message = Cdr(raw)
    stamp_s = message.stamp_s()
    first, _, step, _, _, nearest_m, farthest_m = message.values("7f", 4)
    return LaserScan(source, stamp_s, arrival_s, message.floats(), first, step, nearest_m, farthest_m)
