"""Checks of a joint trajectory controller, without ROS. Metres, radians, seconds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from enum import IntEnum
from itertools import pairwise

from robots.simulator.joints.joint_table import JOINTS
from robots.simulator.joints.motions import Point, RefusedError

GOAL_TOLERANCE = 0.005


class ErrorCode(IntEnum):
    """FollowJointTrajectoryResult's codes that are used here."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    GOAL_TOLERANCE_VIOLATED = -5


def joints_of(controller: str) -> list[str]:
    """Return the joints that `controller` moves."""
    return [name for name, joint in JOINTS.items() if joint.controller == controller]


def check(controller: str, joints: Sequence[str], points: Sequence[Point]) -> None:
    """Check that a trajectory names all joints of this controller, no others, and is valid.

    Raises `RefusedError`.
    """
    if sorted(joints) != sorted(joints_of(controller)):
        text = f"{controller} moves {', '.join(joints_of(controller))}, not {', '.join(joints) or 'nothing'}"
        raise RefusedError(ErrorCode.INVALID_JOINTS, text)
    if not points:
        raise RefusedError(ErrorCode.INVALID_GOAL, "the trajectory has no points")
    if any(len(point.positions) != len(joints) for point in points):
        raise RefusedError(ErrorCode.INVALID_GOAL, "a point has not one position for each joint")
    times = [point.time_from_start for point in points]
    if times[0] < 0.0 or any(later <= earlier for earlier, later in pairwise(times)):
        raise RefusedError(ErrorCode.INVALID_GOAL, "the points' times do not ascend")
    if not all(math.isfinite(position) for point in points for position in point.positions):
        raise RefusedError(ErrorCode.INVALID_GOAL, "a position is not a number")


def missed(joints: Sequence[str], goal: Point, positions: Mapping[str, float]) -> list[str]:
    """Return the joints that did not reach the goal, for example a goal beyond their limits."""
    pairs = zip(joints, goal.positions, strict=True)
    return [joint for joint, wanted in pairs if abs(positions[joint] - wanted) > GOAL_TOLERANCE]
