"""The way towards a goal: speed up, keep the speed, brake in time; and the way travelled so far. Pure.

Metres for a distance, radians for an angle; seconds. The gate judges each speed afterwards.
"""

from __future__ import annotations

import math

from robots.bridge.gate.values import Pose

BRAKING_SHARE = 0.65  # of the acceleration: a loaded robot brakes later than it should
# The speed follows odometry that is late. With less than twice the latency to react, it would swing past the goal.
REACTIONS = 2.0
ARRIVED = 0.005  # m or rad before the goal: the robot rolls on while the zero is on its way


def speed_towards(
    left: float,
    before: float,
    most: float,
    slowest: float,
    acceleration: float,
    latency_s: float,
    passed_s: float,
) -> float:
    """Return the next speed (positive) with `left` to go, `passed_s` after the speed `before`; 0 at the goal.

    It rises by the acceleration, is `most` at most, and falls so that braking ends at the goal:
    v T + v^2 / 2a = left. The last bit is driven at `slowest`.
    """
    if left <= ARRIVED:
        return 0.0
    brakes = BRAKING_SHARE * acceleration
    reaction = brakes * REACTIONS * latency_s
    in_time = math.sqrt(reaction**2 + 2.0 * brakes * left) - reaction
    risen = before + acceleration * passed_s
    return min(risen, most, max(in_time, slowest))


class Travelled:
    """The way since a start, by odometry: metres along the heading at the start, and the angle turned, in radians.

    The angle counts on beyond half a turn: call `moved` with every pose.
    """

    def __init__(self, start: Pose) -> None:
        self._start = self._last = start
        self.distance_m = 0.0
        self.angle_rad = 0.0

    def moved(self, pose: Pose) -> None:
        """Take the newest pose."""
        along, across = math.cos(self._start.yaw), math.sin(self._start.yaw)
        self.distance_m = (pose.x - self._start.x) * along + (pose.y - self._start.y) * across
        self.angle_rad += math.remainder(pose.yaw - self._last.yaw, math.tau)
        self._last = pose
