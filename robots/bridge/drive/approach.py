"""The speed towards a goal (speed up, keep the speed, brake in time), and the distance driven so far. Pure.

Units: metres for a distance, radians for an angle, seconds. The gate then checks each speed.
"""

from __future__ import annotations

import math

from robots.shared.geometry.poses import Pose

BRAKING_SHARE = 0.65  # braking / acceleration: a loaded robot brakes more slowly than it should
# Reaction time in latencies. Odometry is late: with a value below 2, the robot moves past the goal.
REACTIONS = 2.0
ARRIVED = 0.005  # m or rad before the goal, zero is sent: the robot rolls on until the zero takes effect


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

    The speed increases by the acceleration up to `most`. It decreases so that braking ends at the goal:
    v T + v^2 / 2a = left (T: reaction time). Near the goal, the speed is `slowest`.
    """
    if left <= ARRIVED:
        return 0.0
    brakes = BRAKING_SHARE * acceleration
    reaction = brakes * REACTIONS * latency_s
    in_time = math.sqrt(reaction**2 + 2.0 * brakes * left) - reaction
    risen = before + acceleration * passed_s
    return min(risen, most, max(in_time, slowest))


class Travelled:
    """The motion since a start, by odometry: distance (m) along the heading at the start, and angle (rad).

    The angle may be larger than half a turn. So call `moved` with every pose.
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
