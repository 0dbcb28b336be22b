"""Where the head has to turn so that it looks at something, without ROS. Metres, radians, base frame.

The way of PAL's head action: an axis of a frame that the head carries is brought onto the target, as far as
the neck turns.
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

# The frame looks from beside the joints that turn it. Each round shrinks what that displaces to about the
# offset's part of the distance.
_ROUNDS = 12
_SHORTEST = 1e-6


class GazeError(ValueError):
    """The head cannot point at that target."""


class Eye(NamedTuple):
    """The axis that should point at the target: origin and unit vector in the head's frame."""

    origin: Matrix
    axis: Matrix


def eye(table: Sequence[Frame], frame: str, axis: Sequence[float]) -> Eye:
    """The `axis` of `frame`. As the robot does: the head's own where none is named, forward where no axis is."""
    placed = place(table, frame or HEAD, {}, root=HEAD)
    wanted = np.array(axis, dtype=float)
    length = float(np.linalg.norm(wanted))
    if not math.isfinite(length):
        raise GazeError("the pointing axis is not a number")
    unit = wanted / length if length > _SHORTEST else np.array([1.0, 0.0, 0.0])
    return Eye(placed.origin, placed.axes @ unit)


def aim(table: Sequence[Frame], looks: Eye, target: Matrix, joints: Mapping[str, float]) -> dict[str, float]:
    """Pan and tilt that bring the eye onto `target`, held within the neck's limits."""
    if not np.isfinite(target).all():
        raise GazeError("the target is not a point")
    wanted = dict(joints)
    for _ in range(_ROUNDS):
        pan, tilt = _turned(looks.axis, _direction(table, looks, target, wanted))
        wanted[PAN] = clamp(pan, JOINTS[PAN].low, JOINTS[PAN].high)
        wanted[TILT] = clamp(tilt, JOINTS[TILT].low, JOINTS[TILT].high)
    return {PAN: wanted[PAN], TILT: wanted[TILT]}


def error(table: Sequence[Frame], looks: Eye, target: Matrix, joints: Mapping[str, float]) -> float:
    """The angle between where the eye looks and where the target is."""
    looking = place(table, HEAD, joints).axes @ looks.axis
    wanted = _direction(table, looks, target, joints)
    return math.atan2(float(np.linalg.norm(np.cross(looking, wanted))), float(looking @ wanted))


def _direction(table: Sequence[Frame], looks: Eye, target: Matrix, joints: Mapping[str, float]) -> Matrix:
    """The unit vector from the eye to `target`."""
    way = target - place(table, HEAD, joints).point(looks.origin)
    length = float(np.linalg.norm(way))
    if length < _SHORTEST:
        raise GazeError("the target is where the eye is")
    unit: Matrix = way / length
    return unit


def _turned(axis: Matrix, direction: Matrix) -> tuple[float, float]:
    """Pan and tilt that turn the head's `axis` into `direction`. Tilt moves it on a circle about the left."""
    forward, left, up = axis.tolist()
    x, y, z = direction.tolist()
    circle = math.hypot(forward, up)
    raised = math.asin(clamp(z / circle, -1.0, 1.0)) if circle > _SHORTEST else 0.0
    pan = math.atan2(y, x) - math.atan2(left, circle * math.cos(raised))
    return math.remainder(pan, math.tau), math.remainder(raised - math.atan2(up, forward), math.tau)
