"""Recent poses by the stamps of the odometry, to transform older points to the present."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from typing import Literal

from robots.bridge.gate.timing.freshness import CLOCK_SET_BACK_S
from robots.bridge.gate.timing.tremble import Rest
from robots.bridge.gate.timing.unseen_motion import Doubt, difference
from robots.shared.geometry.planar import ORIGIN, put, relative_to, wrapped
from robots.shared.geometry.poses import Pose, Velocity

KEPT = 200  # poses: 4 s at 50 Hz; no sensor's data are used for longer than 0.5 s
# Longest interpolation between two poses, and extrapolation beyond the newest. A longer hole is a gap.
LARGEST_HOLE_S = 0.2
JUMP_M = 0.3  # if a pose is farther away than the base can move plus this, the odometry was reset
JUMP_RAD = 0.5
JUST_BEFORE_S = 1e-6  # stamps since 1970 have a resolution of 0.24 us

Break = Literal["stamps_back", "jump"]  # the next pose is in another frame


class Trail:
    """The newest poses, oldest first, with strictly growing stamps of the robot's clock (seconds)."""

    def __init__(self, fastest_mps: float, fastest_radps: float) -> None:
        self._fastest_mps = fastest_mps
        self._fastest_radps = fastest_radps
        self._stamps: list[float] = []
        self._poses: list[Pose] = []
        self._velocity = Velocity(0.0, 0.0, 0.0)
        self.rest = Rest()
        self._frame = ORIGIN  # the odometry's frame after corrections of wrongly reported turns
        self._reported_yaw = 0.0
        self.turn_share = 1.0  # correction factor for turns that the odometry reports from now on
        self.revision = 0
        self.resets = 0  # number of changes of the frame

    @property
    def newest(self) -> Pose | None:
        return self._poses[-1] if self._poses else None

    def add(self, stamp_s: float, pose: Pose, velocity: Velocity) -> None:
        """Take the newest pose, which continues the last one."""
        corrected = self.corrected(pose)
        if self.turn_share != 1.0 and self._poses:
            off = (self.turn_share - 1.0) * wrapped(pose.yaw - self._reported_yaw)
            turned = corrected._replace(yaw=wrapped(corrected.yaw + off))
            self._frame = put(relative_to(self._frame, corrected), turned)
            corrected = turned
        self._reported_yaw = pose.yaw
        self._stamps.append(stamp_s)
        self._poses.append(corrected)
        self.rest.follow(stamp_s, corrected, velocity)
        self._velocity = velocity._replace(w=self.turn_share * velocity.w)
        self.revision += 1
        if len(self._stamps) > 2 * KEPT:
            del self._stamps[:KEPT], self._poses[:KEPT]

    def missing_s(self, stamp_s: float, silent_s: float) -> float:
        """Return the seconds without odometry before a message that came `silent_s` after the last one.

        Stamps and arrivals both must show it: if a clock was set forward, there is no silence, and after a burst
        of late messages, no hole in the stamps. Negative: the stamp went back.
        """
        return min(stamp_s - self._stamps[-1], silent_s) if self._stamps else 0.0

    def rewind(self, stamp_s: float) -> bool:
        """Put the newest pose just before a stamp that is a little older; return whether that is possible.

        Not if the stamp went back by `CLOCK_SET_BACK_S` or more, or is older than all poses. Poses between the two
        stamps are dropped: a time server set the clock back, or a single stamp was ahead.
        """
        before_s = stamp_s - JUST_BEFORE_S
        at = bisect_left(self._stamps, before_s)
        if at == 0 or self._stamps[-1] - stamp_s >= CLOCK_SET_BACK_S:
            return False
        self._stamps[at:], self._poses[at:] = [before_s], [self._poses[-1]]
        return True

    def break_before(self, pose: Pose, missing_s: float, doubt: Doubt | None) -> Break | None:
        """Return why a pose is in another frame than the last one, if it is.

        `missing_s`: as of the method of this name. `doubt`: how far the robot may have moved in a gap.
        """
        if not self._stamps:
            return None
        if missing_s < 0.0:
            return "stamps_back"
        moved = self.shift(pose)
        most_m, most_rad = doubt or (
            2.0 * self._fastest_mps * missing_s,
            2.0 * self._fastest_radps * missing_s,
        )
        return "jump" if moved.metres > JUMP_M + most_m or moved.radians > JUMP_RAD + most_rad else None

    def shift(self, pose: Pose) -> Doubt:
        """Return how far the robot moved from the newest pose to the next one, `pose`."""
        return difference(self.corrected(pose), self._poses[-1])

    def forget(self) -> None:
        """Begin a new frame: places in the old one are unknown now."""
        self._stamps.clear()
        self._poses.clear()
        self.rest = Rest()
        self._frame = ORIGIN
        self.turn_share = 1.0
        self.resets += 1

    def turn(self, since_s: float, stamp_s: float, off: float) -> None:
        """Correct the yaw: from `since_s` to `stamp_s` the robot turned `off` radians more than the odometry reported.

        Later poses are turned with it. Raises ValueError if the pose at `stamp_s` is unknown.
        """
        about = self.pose_at(stamp_s)
        if about is None:
            raise ValueError("no pose of that time is known")
        turned = about._replace(yaw=wrapped(about.yaw + off))
        for n in range(bisect_right(self._stamps, since_s), len(self._poses)):
            pose, share = self._poses[n], (self._stamps[n] - since_s) / (stamp_s - since_s)
            if share < 1.0:
                self._poses[n] = pose._replace(yaw=wrapped(pose.yaw + share * off))
            else:
                self._poses[n] = put(relative_to(pose, about), turned)
        self._frame = put(relative_to(self._frame, about), turned)
        self.revision += 1

    def pose_at(self, stamp_s: float) -> Pose | None:
        """Return the pose at a stamp; None if it is unknown."""
        if not self._stamps or stamp_s < self._stamps[0]:
            return None
        after = bisect_left(self._stamps, stamp_s)
        if after == len(self._stamps):
            return self._extrapolated(stamp_s - self._stamps[-1])
        if self._stamps[after] == stamp_s:
            return self._poses[after]
        hole = self._stamps[after] - self._stamps[after - 1]
        if hole > LARGEST_HOLE_S:
            return None
        return between(self._poses[after - 1], self._poses[after], (stamp_s - self._stamps[after - 1]) / hole)

    def steadied_at(self, stamp_s: float) -> Pose | None:
        """Return the resting pose if the robot stands or hardly moves (some odometry trembles); else `pose_at`."""
        pose = self.pose_at(stamp_s)
        return None if pose is None else self.rest.steadied(pose)

    def _extrapolated(self, ahead_s: float) -> Pose | None:
        """Extrapolate the newest pose with its velocity: a scan's stamp is often newer than the odometry."""
        if ahead_s > LARGEST_HOLE_S:
            return None
        pose, velocity = self._poses[-1], self._velocity
        heading = pose.yaw + velocity.w * ahead_s / 2.0
        cos, sin = math.cos(heading), math.sin(heading)
        return Pose(
            pose.x + ahead_s * (cos * velocity.vx - sin * velocity.vy),
            pose.y + ahead_s * (sin * velocity.vx + cos * velocity.vy),
            wrapped(pose.yaw + velocity.w * ahead_s),
        )

    def corrected(self, pose: Pose) -> Pose:
        """Return a reported pose in the frame of the corrected turns."""
        return pose if self._frame is ORIGIN else put(pose, self._frame)


def between(first: Pose, second: Pose, share: float) -> Pose:
    """Interpolate between two poses, turning the short way."""
    return Pose(
        first.x + share * (second.x - first.x),
        first.y + share * (second.y - first.y),
        wrapped(first.yaw + share * wrapped(second.yaw - first.yaw)),
    )
