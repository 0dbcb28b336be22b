"""The true geometry around the robot, from MuJoCo's model: how far the way of a twist is free.

It does not use `robots.bridge.gate`: it computes poses along the arc, and their distances to the true
outlines.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.shared.geometry.poses import Velocity
from robots.simulator.physics.mujoco_world import Physics, Pose
from robots.simulator.physics.scene import ROBOT_GROUP

RADIUS_M = 0.27
ASIDE_M = 0.05  # a way does not count as free if it is nearer to an object than this
TOP_M = 1.15  # height of the robot
_NEARER_M = 0.005  # a way out of a narrow place may come nearer by this
_STEP_M = 0.03  # between points, and between poses
Floats = NDArray[np.float64]


class Truth:
    """Points on the outlines of all objects in a world without walkers, (N, 2)."""

    def __init__(self, physics: Physics) -> None:
        model, data = physics.model, physics.data
        outlines = [
            outline(model, data, geom)
            for geom in range(model.ngeom)
            if model.geom_group[geom] != ROBOT_GROUP
            and model.geom_contype[geom]
            and _is_low(model, data, geom)
        ]
        self.points: Floats = np.concatenate(outlines) if outlines else np.zeros((0, 2))

    def free_m(self, pose: Pose, twist: Velocity, longest_m: float, *, from_near: bool = False) -> float:
        """Return how far the robot could drive with `twist` before it comes near an object.

        For a turn on the spot this is `longest_m`. With `from_near`, a way that begins near an object is also
        free as long as it comes no nearer.
        """
        if not twist.vx or not len(self.points):
            return longest_m
        near = np.abs(self.points - (pose.x, pose.y)).max(axis=1) < longest_m + RADIUS_M + ASIDE_M
        points = self.points[near]
        way = np.arange(0.0, longest_m + _STEP_M, _STEP_M)
        forward = math.copysign(1.0, twist.vx)
        curvature = twist.w / abs(twist.vx)
        yaw = pose.yaw + curvature * way
        middle = yaw - curvature * _STEP_M / 2.0
        x = pose.x + np.concatenate(([0.0], np.cumsum(forward * _STEP_M * np.cos(middle[1:]))))
        y = pose.y + np.concatenate(([0.0], np.cumsum(forward * _STEP_M * np.sin(middle[1:]))))
        distance = np.hypot(x[:, None] - points[:, 0], y[:, None] - points[:, 1])
        reach_m = RADIUS_M + ASIDE_M
        if from_near and distance.size:
            reach_m = min(reach_m, float(distance[0].min()) - _NEARER_M)
        met = np.flatnonzero((distance < reach_m).any(axis=1))
        return float(way[met[0]]) if len(met) else longest_m


def _is_low(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> bool:
    upright = model.geom_size[geom][1 if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CYLINDER else 2]
    return float(data.geom_xpos[geom][2] - upright) < TOP_M


def outline(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> Floats:
    """Return points around one upright box or cylinder, (N, 2)."""
    size, at = model.geom_size[geom], data.geom_xpos[geom][:2]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CYLINDER:
        angles = np.linspace(0.0, math.tau, max(8, math.ceil(math.tau * size[0] / _STEP_M)), endpoint=False)
        round_it: Floats = at + size[0] * np.stack((np.cos(angles), np.sin(angles)), axis=1)
        return round_it
    half_x, half_y = size[:2]
    along = np.linspace(-1.0, 1.0, max(2, math.ceil(2.0 * half_x / _STEP_M) + 1))
    across = np.linspace(-1.0, 1.0, max(2, math.ceil(2.0 * half_y / _STEP_M) + 1))
    sides = [
        np.stack((half_x * along, np.full_like(along, sign * half_y)), axis=1) for sign in (-1.0, 1.0)
    ] + [np.stack((np.full_like(across, sign * half_x), half_y * across), axis=1) for sign in (-1.0, 1.0)]
    around: Floats = at + np.concatenate(sides) @ data.geom_xmat[geom].reshape(3, 3)[:2, :2].T
    return around
