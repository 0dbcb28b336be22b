"""Whether something has looked for table tops behind the robot (docs/safety.md, Reverse).

Laser and sonars see no table top, and no depth camera looks back. So the way back is known only where the depth camera
has looked, or where the robot itself has been: its body found no table there.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.geometry.planar import Points, from_columns, placed
from robots.bridge.gate.obstacles.depth_camera import DepthCamera
from robots.bridge.gate.obstacles.point_memory import TURN_M
from robots.bridge.gate.timing.tremble import Odometer
from robots.bridge.gate.timing.unseen_motion import Doubt
from robots.bridge.gate.values import Pose

CELL_M = 0.1
CELLS = 128  # along each side of the grid, a power of two: 12.8 m
LASTS_S = 120.0  # tables are moved, too
LASTS_M = 6.0  # driven, as for what the depth camera remembers
MARKED_M, MARKED_S = 0.04, 1.0  # the robot's own place is marked again after this way, or this time
SEEN_TO_M = 3.0  # from the middle of the base, in a picture that looks ahead
BEARING_RAD = 0.05
WAY_M = (0.1, 0.2, 0.3)  # of the hull's rear: farther than it needs to stand
REAR_RAD = math.radians(60.0)  # of the hull to each side: farther forward, it moves along places beside it
CERTAIN_M, CERTAIN_RAD = 0.05, 0.05  # half a cell: with a larger error of the pose, the floor may be another
RIM_M = 0.06  # narrower than the hull: a cell counts as a whole


class Behind:
    """The floor that was looked at."""

    def __init__(self, radius_m: float) -> None:
        """`radius_m`: of the hull, without the arm."""
        self._radius_m = radius_m
        self._body = _disc(radius_m)
        rear = _rear(radius_m - RIM_M)
        self._way = np.concatenate([rear - (way_m, 0.0) for way_m in WAY_M])
        self._cell = np.full((CELLS * CELLS, 2), np.iinfo(np.int64).min)
        self._until_s, self._until_m = np.full((2, CELLS * CELLS), -math.inf)
        self._odometer = Odometer()
        self._marked: tuple[Pose, float] | None = None

    def moved(self, pose: Pose, now_s: float) -> None:
        """Take the robot's pose: no table is where its body is."""
        self._odometer.follow(pose)
        if self._marked is not None:
            there, marked_s = self._marked
            near = math.hypot(pose.x - there.x, pose.y - there.y) < MARKED_M
            if near and now_s - marked_s < MARKED_S:
                return
        self._marked = pose, now_s
        self._mark(placed(self._body, pose), now_s)

    def looked(self, camera: DepthCamera, pose: Pose, now_s: float) -> None:
        """Take that the depth camera looks: up to the first obstacle in each direction."""
        if (sector := camera.sector) is None:
            return
        heading, half = sector
        bearings = np.arange(heading - half, heading + half, BEARING_RAD)
        ranges = np.arange(self._radius_m, SEEN_TO_M, 0.8 * CELL_M)
        free_m = _nearest_m(camera.columns, bearings)
        bearing, range_m = np.meshgrid(bearings, ranges)
        visible = range_m < free_m[None, :]
        bearing, range_m = bearing[visible], range_m[visible]
        self._mark(placed(from_columns(range_m * np.cos(bearing), range_m * np.sin(bearing)), pose), now_s)

    def forget(self) -> None:
        """Forget everything: the poses are in a new frame or doubtful, or a person asked for it."""
        self._until_s.fill(-math.inf)
        self._marked = None
        self._odometer.jump()

    def doubt(self, doubt: Doubt) -> None:
        """Note that the robot's pose may be wrong by this much."""
        if doubt.metres > CERTAIN_M or doubt.radians > CERTAIN_RAD:
            self.forget()

    def knows(self, pose: Pose, now_s: float) -> bool:
        """Return whether all of the way straight back from this pose was looked at."""
        cells, entries = _entries(placed(self._way, pose))
        known: NDArray[np.bool_] = (
            (self._cell[entries] == cells).all(axis=1)
            & (self._until_s[entries] >= now_s)
            & (self._until_m[entries] >= self._travelled_m)
        )
        return bool(known.all())

    def _mark(self, points: Points, now_s: float) -> None:
        cells, entries = _entries(points)
        self._cell[entries] = cells
        self._until_s[entries] = now_s + LASTS_S
        self._until_m[entries] = self._travelled_m + LASTS_M

    @property
    def _travelled_m(self) -> float:
        return self._odometer.driven_m + TURN_M * self._odometer.turned_rad


def _entries(points: Points) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the cells of these points, and their entries in the grid, which moves with the robot."""
    cells = np.floor(points / CELL_M).astype(np.int64)
    wrapped = cells & (CELLS - 1)
    return cells, wrapped[:, 0] * CELLS + wrapped[:, 1]


def _nearest_m(columns: Points, bearings: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of the nearest obstacle in each of these directions, base frame; infinite: none."""
    if not len(columns):
        return np.full(len(bearings), math.inf)
    x, y = columns.T
    off = np.abs(np.arctan2(y, x)[None, :] - bearings[:, None])
    away: NDArray[np.float64] = np.where(off < BEARING_RAD, np.hypot(x, y)[None, :], math.inf).min(axis=1)
    return away


def _disc(radius_m: float) -> Points:
    steps = np.arange(-radius_m, radius_m + CELL_M / 2.0, CELL_M / 2.0)
    x, y = (axis.ravel() for axis in np.meshgrid(steps, steps))
    inside = np.hypot(x, y) <= radius_m
    return from_columns(x[inside], y[inside])


def _rear(radius_m: float) -> Points:
    angles = np.linspace(math.pi - REAR_RAD, math.pi + REAR_RAD, 13)
    return from_columns(radius_m * np.cos(angles), radius_m * np.sin(angles))
