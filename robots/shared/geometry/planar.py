"""Planar frames: transform poses and points between them. Points are (N, 2) arrays in metres."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.shared.geometry.poses import Pose

Points = NDArray[np.float64]

NO_POINTS: Points = np.empty((0, 2))
ORIGIN = Pose(0.0, 0.0, 0.0)


class Path(NamedTuple):
    """Several rows of poses that follow each other: each array is (rows, poses)."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    yaw: NDArray[np.float64]
    time_s: NDArray[np.float64]


class Drift(NamedTuple):
    """How points move: velocities (N, 2) in m/s, and discs about them: radii (N,) in m that grow with `grows` in m/s.

    A disc holds all places where something may be that is seen and followed with errors.
    """

    velocity: Points
    radius: NDArray[np.float64]
    grows: NDArray[np.float64]

    def chosen(self, rows: NDArray[np.intp]) -> Drift:
        """Return the drift of some of the points."""
        return Drift(chosen(self.velocity, rows), self.radius.take(rows), self.grows.take(rows))

    @property
    def moves(self) -> NDArray[np.bool_]:
        """The points that do not stand."""
        moves: NDArray[np.bool_] = self.velocity.any(axis=1) | (self.grows > 0.0)
        return moves


def wrapped(angle: float) -> float:
    """Return the same angle in -pi..pi."""
    return math.remainder(angle, math.tau)


def from_columns(x: NDArray[np.float64], y: NDArray[np.float64]) -> Points:
    """Return points (N, 2) with each column contiguous in memory: quicker for the arithmetic."""
    return np.array((x, y)).T


def chosen(points: Points, rows: NDArray[np.intp]) -> Points:
    """Return some of the points, again with contiguous columns."""
    some: Points = points.T.take(rows, axis=1).T
    return some


def placed(points: Points, pose: Pose) -> Points:
    """Transform points from the frame at `pose` to the frame in which `pose` is given."""
    turn, shift = np.empty((2, 2)), np.empty((2, 1))  # filled one by one: quicker than from nested tuples
    turn[0, 0] = turn[1, 1] = math.cos(pose.yaw)
    turn[1, 0] = sin = math.sin(pose.yaw)
    turn[0, 1] = -sin
    shift[0, 0], shift[1, 0] = pose.x, pose.y
    there = turn @ points.T
    there += shift
    return there.T


def relative_to(pose: Pose, viewer: Pose) -> Pose:
    """Return `pose` in the frame at `viewer`; both are given in one frame."""
    dx, dy = pose.x - viewer.x, pose.y - viewer.y
    cos, sin = math.cos(viewer.yaw), math.sin(viewer.yaw)
    return Pose(cos * dx + sin * dy, -sin * dx + cos * dy, wrapped(pose.yaw - viewer.yaw))


def put(pose: Pose, base: Pose) -> Pose:
    """Transform `pose` from the frame at `base` to the frame in which `base` is given."""
    cos, sin = math.cos(base.yaw), math.sin(base.yaw)
    x, y = base.x + cos * pose.x - sin * pose.y, base.y + sin * pose.x + cos * pose.y
    return Pose(x, y, wrapped(base.yaw + pose.yaw))


def joined(parts: list[Points]) -> Points:
    """Return all points of several arrays, in order."""
    some = [part.T for part in parts if len(part)]
    if len(some) < 2:
        return some[0].T if some else NO_POINTS
    return np.concatenate(some, axis=1).T
