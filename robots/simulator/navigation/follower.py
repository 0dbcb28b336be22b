"""Local following: a twist towards a point of the path ahead (pure pursuit), slower near seen obstacles."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robots.simulator.navigation.planner import Point
from robots.simulator.physics.base import STILL, Twist, clamp
from robots.simulator.physics.mujoco_world import Pose

FASTEST_MPS = 0.5
NARROW_MPS = 0.25  # where a wall is nearer than `NARROW_M` to the robot's middle
NARROW_M = 0.45
AHEAD_M = 0.4  # distance to the point of the path towards which the robot steers
TURN_FIRST_RAD = 0.6  # the robot turns on the spot if the path's direction differs by more than this
FASTEST_RADPS = 0.8
SLOW_DOWN_PER_S = 1.0  # highest speed (m/s) per metre to the goal
LOOKS_AHEAD_S = (0.25, 0.5, 0.75, 1.0, 1.25)
THERE_M, THERE_RAD = 0.12, 0.12
LEFT_M = 0.2  # a robot that turns at its goal stays "there" if localisation shifts it by less than this

Points = NDArray[np.float64]  # rows of x, y


def nearest(path: list[Point], pose: Pose) -> int:
    """Return the index of the path's nearest point."""
    return min(range(len(path)), key=lambda index: math.dist(path[index], pose[:2]))


def steering_point(path: list[Point], pose: Pose) -> Point:
    """Return the path's first point after the nearest one that is `AHEAD_M` away, else the path's end."""
    for point in path[nearest(path, pose) :]:
        if math.dist(point, pose[:2]) >= AHEAD_M:
            return point
    return path[-1]


def is_there(path: list[Point], pose: Pose, was_there: bool) -> bool:
    """Return whether the robot is at the end of the path. Once there, it may be up to `LEFT_M` away."""
    return math.dist(path[-1], pose[:2]) < (LEFT_M if was_there else THERE_M)


def follow(path: list[Point], heading: float, pose: Pose, clear_m: float, there: bool) -> Twist | None:
    """Return the twist along the path at `pose` (map), or the turn to `heading` if the robot is `there`.

    None: the robot has arrived.
    """
    if there:
        off = math.remainder(heading - pose.yaw, math.tau)
        return None if abs(off) < THERE_RAD else Twist(w=turn_towards(off))
    x, y = steering_point(path, pose)
    off = math.remainder(math.atan2(y - pose.y, x - pose.x) - pose.yaw, math.tau)
    if abs(off) > TURN_FIRST_RAD:
        return Twist(w=turn_towards(off))
    fastest = NARROW_MPS if clear_m < NARROW_M else FASTEST_MPS
    speed = min(fastest * math.cos(off), max(0.08, SLOW_DOWN_PER_S * math.dist(path[-1], pose[:2])))
    turn = 2.0 * speed * math.sin(off) / max(AHEAD_M, math.dist((x, y), pose[:2]))
    return Twist(speed, 0.0, clamp(turn, -FASTEST_RADPS, FASTEST_RADPS))


def turn_towards(off: float) -> float:
    """Return the rotation (rad/s) on the spot for a heading error `off` (rad)."""
    return clamp(2.0 * off, -FASTEST_RADPS, FASTEST_RADPS) if abs(off) > 0.1 else math.copysign(0.2, off)


def held_back(twist: Twist, seen: Points, hull_m: float) -> Twist:
    """Return the twist, or the largest share of it that hits none of the points `seen` (base frame)."""
    if twist.vx == 0.0 or not len(seen):
        return twist
    for share, margin_m in ((1.0, 0.03), (0.6, 0.02), (0.3, 0.01)):
        slower = Twist(twist.vx * share, 0.0, twist.w * share)
        if all(_clear(slower, seconds, seen, hull_m + margin_m) for seconds in LOOKS_AHEAD_S):
            return slower
    # The robot can turn on the spot, since its hull is round: the way may be free in another direction.
    return Twist(w=math.copysign(0.3, twist.w)) if abs(twist.w) > 0.05 else STILL


def _clear(twist: Twist, seconds: float, seen: Points, radius_m: float) -> bool:
    turned = twist.w * seconds
    if abs(turned) > 1e-3:
        radius = twist.vx / twist.w
        x, y = radius * math.sin(turned), radius * (1.0 - math.cos(turned))
    else:
        x, y = twist.vx * seconds, 0.0
    ahead = seen[seen[:, 0] > 0.0]
    return bool((np.hypot(ahead[:, 0] - x, ahead[:, 1] - y) > radius_m).all())
