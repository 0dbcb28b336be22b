"""Odometry that trembles: some robots report poses that differ by millimetres while they stand (docs/gate.md, 7)."""

from __future__ import annotations

import math

from robots.shared.geometry.planar import wrapped
from robots.shared.geometry.poses import Pose, Velocity

# Limits for poses with a noise of 2 mm and 2 mrad (standard deviation), with room for rare larger errors.
TREMBLES_M, TREMBLES_RAD = 0.015, 0.015  # distance from an older pose, which trembles, too
OFF_M, OFF_RAD = 0.012, 0.012  # distance from the mean pose
MEAN_SHARE = 0.125  # weight of the newest pose in the mean: at 2 mm, the mean trembles by 0.5 mm
REST_M, REST_RAD = 0.003, 0.003  # distance of the resting pose from the mean, which trembles less
MOVED_M, MOVED_RAD = 0.001, 0.001  # if the robot moves, its resting pose moves farther than this
STANDS_S = 0.5  # a robot whose resting pose did not move for this time stands
CANCEL_SHARE = 0.75  # speeds cancel out if their mean is below this share of the mean of their amounts


class Odometer:
    """Counts the distance that the robot has driven and the angle that it has turned.

    Poses that tremble about one place add nothing; nor do short moves there and back.
    """

    def __init__(self) -> None:
        self.driven_m = 0.0
        self.turned_rad = 0.0
        self._from: Pose | None = None

    def follow(self, pose: Pose) -> None:
        """Add the distance and turn to `pose` if they are too large for noise."""
        there = self._from or pose
        driven_m, turned = _apart_m(pose, there), abs(wrapped(pose.yaw - there.yaw))
        if self._from is None or driven_m > TREMBLES_M or turned > TREMBLES_RAD:
            self.driven_m += driven_m
            self.turned_rad += turned
            self._from = pose

    def jump(self) -> None:
        """Note that the next pose is in another frame: it adds nothing."""
        self._from = None


class Rest:
    """The resting pose: constant while the robot stands; it follows the mean pose at a short distance."""

    def __init__(self) -> None:
        self.pose: Pose | None = None
        self._mean = self._began = Pose(0.0, 0.0, 0.0)
        self._began_s = self._newest_s = 0.0
        self._velocity = Velocity(0.0, 0.0, 0.0)
        self._vx = self._vy = self._w = 0.0  # mean velocity
        self._speed_mps = self._turn_radps = 0.0  # means of the amounts

    def follow(self, stamp_s: float, pose: Pose, velocity: Velocity) -> None:
        """Take the newest odometry."""
        self._newest_s = stamp_s
        if self.pose is None:
            self.pose = self._mean = self._began = pose
            self._began_s = stamp_s
        self._mean = _pulled(self._mean, 1.0 - MEAN_SHARE, pose, OFF_M, OFF_RAD)
        self.pose = _pulled(self.pose, 1.0, self._mean, REST_M, REST_RAD)
        if not _is_near(self.pose, self._began, MOVED_M, MOVED_RAD):
            self._began, self._began_s = self.pose, stamp_s
        self._velocity = velocity
        vx, vy, w = velocity
        self._vx += MEAN_SHARE * (vx - self._vx)
        self._vy += MEAN_SHARE * (vy - self._vy)
        self._w += MEAN_SHARE * (w - self._w)
        self._speed_mps += MEAN_SHARE * (math.hypot(vx, vy) - self._speed_mps)
        self._turn_radps += MEAN_SHARE * (abs(w) - self._turn_radps)

    def steadied(self, pose: Pose) -> Pose:
        """Return the resting pose if `pose` is so close to it that it may only tremble; else `pose`.

        A robot that moves at up to 0.05 m/s (at 50 Hz) is that close, too: its resting pose follows, at most
        11 mm behind.
        """
        rest = self.pose
        return rest if rest is not None and _is_near(pose, rest, OFF_M - 0.001, OFF_RAD - 0.001) else pose

    def stands(self, still_mps: float, still_radps: float) -> bool:
        """Return whether the newest velocity is below these limits, or only noise at a constant pose."""
        speed_mps, turn_radps = math.hypot(self._velocity.vx, self._velocity.vy), abs(self._velocity.w)
        if speed_mps < still_mps and turn_radps < still_radps:
            return True
        return (
            self._newest_s - self._began_s >= STANDS_S
            and (speed_mps < still_mps or math.hypot(self._vx, self._vy) < CANCEL_SHARE * self._speed_mps)
            and (turn_radps < still_radps or abs(self._w) < CANCEL_SHARE * self._turn_radps)
        )


def _apart_m(one: Pose, other: Pose) -> float:
    return math.hypot(one.x - other.x, one.y - other.y)


def _is_near(one: Pose, other: Pose, metres: float, radians: float) -> bool:
    return _apart_m(one, other) <= metres and abs(wrapped(one.yaw - other.yaw)) <= radians


def _pulled(behind: Pose, share: float, pose: Pose, metres: float, radians: float) -> Pose:
    """Return `behind`, moved to this share of its distance from `pose`, but at most this far from it."""
    dx, dy = share * (behind.x - pose.x), share * (behind.y - pose.y)
    turned = share * wrapped(behind.yaw - pose.yaw)
    away_m = math.hypot(dx, dy)
    if away_m > metres:
        dx, dy = dx * metres / away_m, dy * metres / away_m
    return Pose(pose.x + dx, pose.y + dy, wrapped(pose.yaw + min(max(turned, -radians), radians)))
