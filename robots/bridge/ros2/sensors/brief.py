"""Messages of sensors, read from their bytes: generated classes need ten times as long."""

from __future__ import annotations

from collections.abc import Iterable
from types import SimpleNamespace
from typing import NamedTuple

from robots.bridge.gate.values import LaserScan
from robots.bridge.ros2.sensors.cdr import Cdr
from robots.shared.geometry.poses import Pose, Velocity
from robots.shared.geometry.quaternions import yaw_of


class Odometry(NamedTuple):
    """A nav_msgs/msg/Odometry in the plane."""

    stamp_s: float
    pose: Pose
    velocity: Velocity


def odometry(raw: bytes) -> Odometry:
    """Read a nav_msgs/msg/Odometry."""
    message = Cdr(raw)
    stamp_s = message.skip_header()
    message.skip_text()
    x, y, _, *turn, vx, vy, _, _, _, w = message.values("7d288x6d", 8)
    return Odometry(stamp_s, Pose(x, y, yaw_of(*turn)), Velocity(vx, vy, w))


def scan(raw: bytes, source: str, arrival_s: float) -> LaserScan:
    """Read a sensor_msgs/msg/LaserScan."""
    message = Cdr(raw)
    stamp_s = message.skip_header()
    first, _, step, _, _, nearest_m, farthest_m = message.values("7f", 4)
    return LaserScan(source, stamp_s, arrival_s, message.floats(), first, step, nearest_m, farthest_m)


def sonar(raw: bytes) -> tuple[str, float, float]:
    """Return frame, stamp (s) and distance (m) of a sensor_msgs/msg/Range."""
    message = Cdr(raw)
    stamp_s, frame_id = message.header()
    message.number("B", 1)
    return frame_id, stamp_s, message.values("4f", 4)[3]


def battery(raw: bytes, type_name: str) -> SimpleNamespace:
    """Read what `BatteryCharge` needs of a std_msgs/msg/Float32 or a sensor_msgs/msg/BatteryState."""
    message = Cdr(raw)
    if type_name.endswith("/Float32"):
        return SimpleNamespace(data=message.number("f", 4))
    message.skip_header()
    _, _, _, charge, capacity, _, percentage = message.values("7f", 4)
    return SimpleNamespace(percentage=percentage, charge=charge, capacity=capacity)


def is_true(raw: bytes) -> bool:
    """Read a std_msgs/msg/Bool."""
    return bool(Cdr(raw).number("B", 1))


def text(raw: bytes, longest: int) -> str:
    """Read a std_msgs/msg/String, cut."""
    message = Cdr(raw)
    length = message.number()
    return bytes(message.data(length)[: min(length - 1, longest)]).decode(errors="replace")


class JointStates:
    """Reads sensor_msgs/msg/JointState. Names are decoded only when they differ from those of the message before."""

    def __init__(self) -> None:
        self._known: tuple[bytes, list[str]] = b"", []  # names, raw and decoded

    def positions(self, raw: bytes) -> Iterable[tuple[str, float]]:
        """Return the positions of the joints (rad or m)."""
        message = Cdr(raw)
        message.skip_header()
        known, names = self._known
        message.align(4)
        begin = message.at
        if not known or not message.passes(known):
            names = [message.text() for _ in range(message.number())]
            self._known = message.between(begin), names
        count = message.number()
        if not count:
            return ()
        return zip(names, message.values(f"{count}d", 8), strict=False)
