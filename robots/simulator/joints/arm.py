"""The arm's shape: capsules between the frames of its joints. Metres.

The capsules are slimmer than the real arm, so that the folded arm stays within the base's circle, as on the
real robot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from robots.simulator.joints.frames import Frame, Matrix, place
from robots.simulator.joints.joint_table import HOME, JOINTS


class Segment(NamedTuple):
    """A capsule between the origins of two frames. No joint changes their distance."""

    name: str
    begin: str
    end: str
    radius: float = 0.045


class Capsule(NamedTuple):
    """A segment's pose in the base frame: its middle, and the quaternion (w, x, y, z) that turns z along it."""

    middle: Matrix
    rotation: Matrix


SEGMENTS = (
    Segment("shoulder", "arm_1_link", "arm_2_link"),
    Segment("upper shoulder", "arm_2_link", "arm_3_link"),
    Segment("upper arm", "arm_3_link", "arm_4_link"),
    Segment("forearm", "arm_4_link", "arm_6_link"),
    Segment("hand", "arm_6_link", "gripper_grasping_frame"),
)
MOVED_BY = tuple(
    name for name, joint in JOINTS.items() if joint.controller in {"arm_controller", "torso_controller"}
)


def lengths(table: Sequence[Frame]) -> list[float]:
    """Return the length of each segment without its round ends."""
    return [math.dist(*_ends(table, segment, HOME)) for segment in SEGMENTS]


def capsules(table: Sequence[Frame], joints: Mapping[str, float]) -> list[Capsule]:
    """Return the segments' poses at these joint positions."""
    found = []
    for segment in SEGMENTS:
        begin, end = _ends(table, segment, joints)
        found.append(Capsule((begin + end) / 2.0, _laid_along(end - begin)))
    return found


def _ends(table: Sequence[Frame], segment: Segment, joints: Mapping[str, float]) -> tuple[Matrix, Matrix]:
    return place(table, segment.begin, joints).origin, place(table, segment.end, joints).origin


def _laid_along(way: Matrix) -> Matrix:
    """Return the shortest rotation from z to `way`."""
    x, y, z = (way / np.linalg.norm(way)).tolist()
    if z < -0.999999:
        return np.array([0.0, 1.0, 0.0, 0.0])
    turn = np.array([1.0 + z, -y, x, 0.0])
    unit: Matrix = turn / np.linalg.norm(turn)
    return unit
