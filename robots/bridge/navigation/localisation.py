"""The robot's own estimate of its pose on its map, and whether this estimate is good enough.

The pose of the odometry frame in the map frame comes from tf while somebody has control, else from the pose topic. The
covariance comes from the pose topic, on which nothing is sent while the robot stands.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from msgspec import Struct

from robots.bridge.gate.gate import BEYOND_REASON
from robots.shared import wire
from robots.shared.geometry.planar import ORIGIN, put, relative_to, wrapped
from robots.shared.geometry.poses import Pose
from robots.shared.sentences import say
from robots.shared.wire import Refusal

OLD_S = 2.0  # while somebody has control, a transform is too old after this time
# A larger standard deviation is too uncertain. A pose that a person has just set has 0.5 m and 0.3 rad.
UNCERTAIN_M, UNCERTAIN_RAD = 0.6, 0.6
JUMP_M, JUMP_RAD = 0.5, 0.5  # a larger change between two transforms, at the same odometry pose, is a jump

MISSING = Refusal(
    "localisation_missing",
    "Tell the robot first where it is (“Robot is here”): it does not know its place on its map.",
    "robot",
)


class Spread(Struct, frozen=True):
    """Covariance of a pose: m², and rad²."""

    xx: float = 0.0
    xy: float = 0.0
    yy: float = 0.0
    yaw: float = 0.0

    @property
    def ellipse(self) -> tuple[float, float, float]:
        """Standard deviations along the longer and the shorter axis (m), and the direction of the longer (rad)."""
        return _ellipse(self.xx, self.xy, self.yy)

    @property
    def sigma_rad(self) -> float:
        """Standard deviation of the heading."""
        return math.sqrt(max(self.yaw, 0.0))


@lru_cache(8)  # views of a robot that stands ask for the same one
def _ellipse(xx: float, xy: float, yy: float) -> tuple[float, float, float]:
    values, axes = np.linalg.eigh(np.array(((xx, xy), (xy, yy))))
    shorter, longer = (math.sqrt(max(float(value), 0.0)) for value in values)
    return longer, shorter, math.atan2(float(axes[1, 1]), float(axes[0, 1]))


def is_reasonable(*numbers: float) -> bool:
    """Return whether all numbers are finite, and small enough to compute with."""
    return all(abs(number) < BEYOND_REASON for number in numbers)


class Localisation:
    """Stores the reports of the robot's localisation. Times are monotonic seconds."""

    def __init__(self) -> None:
        self._odometry: Pose | None = None
        self._posed: Pose | None = None  # waits for odometry
        self._frame: Pose | None = None  # the odometry frame in the map frame
        self._stamp_s: float | None = None  # of the newest transform
        self._transformed_s = -math.inf  # when the newest transform arrived
        self._heard_s = -math.inf
        self._spread: Spread | None = None
        self.jumped_m = 0.0  # how far the last transform moved the robot on the map, if that was too far

    def forget(self) -> None:
        """Forget the pose: the map or the run of the robot is another one. An old transform may arrive again."""
        self._frame = self._spread = self._odometry = self._posed = None
        self._transformed_s = self._heard_s = -math.inf

    def moved(self, pose: Pose) -> None:
        """Take odometry."""
        self._odometry = pose
        if self._posed is not None:
            self._place(self._posed, pose)

    def transformed(self, stamp_s: float, frame: Pose, now_s: float) -> bool:
        """Take the newest transform. Return whether the robot jumped on its map.

        A transform with the same stamp as the last one is ignored.
        """
        if stamp_s == self._stamp_s or not is_reasonable(*frame):
            return False
        before = self._frame if now_s - self._transformed_s < OLD_S else None
        self._stamp_s, self._frame, self._posed = stamp_s, frame, None
        self._transformed_s = self._heard_s = now_s
        if before is None:
            return False
        at = self._odometry or ORIGIN
        was, is_at = put(at, before), put(at, frame)
        way_m = math.hypot(is_at.x - was.x, is_at.y - was.y)
        if way_m <= JUMP_M and abs(wrapped(is_at.yaw - was.yaw)) <= JUMP_RAD:
            return False
        self.jumped_m = way_m
        return True

    def posed(self, pose: Pose, spread: Spread, now_s: float) -> None:
        """Take a message of the pose topic. Ignore it if a number is not finite or too large."""
        if not is_reasonable(*pose, spread.xx, spread.xy, spread.yy, spread.yaw):
            return
        self._spread, self._heard_s = spread, now_s
        if self._odometry is None:
            self._posed = pose
        elif now_s - self._transformed_s > OLD_S:
            self._place(pose, self._odometry)

    def _place(self, pose: Pose, odometry: Pose) -> None:
        self._posed, self._frame = None, put(relative_to(ORIGIN, odometry), pose)

    @property
    def pose(self) -> Pose | None:
        """The robot's pose on its map; None: unknown."""
        return None if self._frame is None or self._odometry is None else put(self._odometry, self._frame)

    def refuse(self, now_s: float) -> Refusal | None:
        """Return why the robot's pose is not good enough for a goal, while somebody has control."""
        if self.pose is None or self._spread is None:
            return MISSING
        silent_s = now_s - self._transformed_s
        if silent_s > OLD_S:
            text = "The robot’s localisation is silent: it may not know where it is."
            if math.isfinite(silent_s):
                text = say(
                    "The robot’s localisation has been silent for {seconds:.0f} s: it may not know where it is.",
                    seconds=silent_s,
                )
            return Refusal("localisation_old", text, "robot")
        longer_m, _, _ = self._spread.ellipse
        if longer_m > UNCERTAIN_M or self._spread.sigma_rad > UNCERTAIN_RAD:
            turned = math.degrees(self._spread.sigma_rad)
            text = say(
                "The robot is not sure where it is (± {distance:.1f} m, ± {angle:.0f}°): "
                "tell it where it is (“Robot is here”), or drive it a little.",
                distance=longer_m,
                angle=turned,
            )
            return Refusal(
                "localisation_uncertain",
                text,
                "robot",
                {"sigma_m": round(longer_m, 2), "limit_m": UNCERTAIN_M},
            )
        return None

    def view(self, now_s: float, problem: str) -> wire.Location | None:
        """Return the robot's pose, for pages."""
        pose, spread = self.pose, self._spread or Spread()
        if pose is None:
            return None
        longer_m, shorter_m, direction = spread.ellipse
        return wire.Location(
            x=round(pose.x, 3),
            y=round(pose.y, 3),
            heading=round(pose.yaw, 4),
            sigma_m=round(longer_m, 3),
            sigma_across_m=round(shorter_m, 3),
            ellipse_rad=round(direction, 3),
            sigma_rad=round(spread.sigma_rad, 3),
            age_s=round(now_s - self._heard_s, 1),
            problem=problem,
        )
