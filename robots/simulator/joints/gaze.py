"""Computes the head joints that point the head at a target, without ROS. Metres, radians, base frame.

Follows PAL's head action: it points an axis of a frame of the head at the target, as far as the neck turns.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from robots.simulator.joints.frames import Frame, Matrix, place
from robots.simulator.joints.joint_table import JOINTS
from robots.simulator.physics.base import clamp

PAN, TILT = "head_1_joint", "head_2_joint"
HEAD = "head_2_link"
REACHED_RAD = 0.02

# The frame is offset from the joints that turn it. Each iteration multiplies the remaining error by about
# offset / distance.
_ROUNDS = 12
_SHORTEST = 1e-6


class GazeError(ValueError):
    """The head cannot point at that target."""


class Eye(NamedTuple):
    """The axis that should point at the target: origin and unit vector in the head's frame."""

    origin: Matrix
    axis: Matrix


def eye(table: Sequence[Frame], frame: str, axis: Sequence[float]) -> Eye:
    """Return the `axis` of `frame`. Defaults, as on the robot: the head's own frame and its forward axis."""
    placed = place(table, frame or HEAD, {}, root=HEAD)
    wanted = np.array(axis, dtype=float)
    length = float(np.linalg.norm(wanted))
    if not math.isfinite(length):
        raise GazeError("the pointing axis is not a number")
    unit = wanted / length if length > _SHORTEST else np.array([1.0, 0.0, 0.0])
    return Eye(placed.origin, placed.axes @ unit)


def aim(table: Sequence[Frame], looks: Eye, target: Matrix, joints: Mapping[str, float]) -> dict[str, float]:
    """Return pan and tilt that point the eye at `target`, clamped to the neck's limits."""
    if not np.isfinite(target).all():
        raise GazeError("the target is not a point")
    wanted = dict(joints)
    for _ in range(_ROUNDS):
        pan, tilt = _turned(looks.axis, _direction(table, looks, target, wanted))
        wanted[PAN] = clamp(pan, JOINTS[PAN].low, JOINTS[PAN].high)
        wanted[TILT] = clamp(tilt, JOINTS[TILT].low, JOINTS[TILT].high)
    return {PAN: wanted[PAN], TILT: wanted[TILT]}


def error(table: Sequence[Frame], looks: Eye, target: Matrix, joints: Mapping[str, float]) -> float:
    """Return the angle between the eye's axis and the direction of the target."""
    looking = place(table, HEAD, joints).axes @ looks.axis
    wanted = _direction(table, looks, target, joints)
    return math.atan2(float(np.linalg.norm(np.cross(looking, wanted))), float(looking @ wanted))


def _direction(table: Sequence[Frame], looks: Eye, target: Matrix, joints: Mapping[str, float]) -> Matrix:
    """Return the unit vector from the eye to `target`."""
    way = target - place(table, HEAD, joints).point(looks.origin)
    length = float(np.linalg.norm(way))
    if length < _SHORTEST:
        raise GazeError("the target is where the eye is")
    unit: Matrix = way / length
    return unit


def _turned(axis: Matrix, direction: Matrix) -> tuple[float, float]:
    """Return pan and tilt that turn the head's `axis` into `direction`. Tilt rotates it about the left axis."""
    forward, left, up = axis.tolist()
    x, y, z = direction.tolist()
    circle = math.hypot(forward, up)
    raised = math.asin(clamp(z / circle, -1.0, 1.0)) if circle > _SHORTEST else 0.0
    pan = math.atan2(y, x) - math.atan2(left, circle * math.cos(raised))
    return math.remainder(pan, math.tau), math.remainder(raised - math.atan2(up, forward), math.tau)
