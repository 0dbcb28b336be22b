"""Reverse only over floor where something has looked for table tops (docs/safety.md, Reverse).

Laser and sonars see no table top, and no depth camera looks back. So the way back is known only where the depth camera
has looked, or where the robot itself has been: its body found no table there. Elsewhere the first pull is refused. If
reverse is asked again after that, the driver says that he has looked.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.obstacles.depth_camera import DepthCamera
from robots.bridge.gate.obstacles.point_memory import TURN_M
from robots.bridge.gate.timing.tremble import Odometer
from robots.bridge.gate.timing.unseen_motion import Doubt
from robots.shared.geometry.planar import Points, from_columns, placed
from robots.shared.geometry.poses import Pose, Velocity

CELL_M = 0.1
CELLS = 128  # along each side of the grid, a power of two: 12.8 m
LASTS_S = 120.0  # tables are moved, too
LASTS_M = 6.0  # driven, as for what the depth camera remembers
MARKED_M, MARKED_S = 0.04, 1.0  # the robot's own place is marked again after this way, or this time
SEEN_TO_M = 3.0  # from the camera; farther away, a table top is too thin for the picture
TOP_M = 0.35  # tables are deeper than this: if a near edge is below the picture, other parts are in it
BEARING_RAD = 0.05
# The hull's rear is checked along this way: farther than a slow robot needs to stand
WAY_M, STEP_M = 0.2, 0.1
REACTS_S = 0.5  # a fast robot drives on for this time before it brakes
REAR_RAD = math.radians(60.0)  # of the hull to each side: farther forward, it moves along places beside it
CERTAIN_M, CERTAIN_RAD = 0.05, 0.05  # half a cell: with a larger error of the pose, the floor may be another
RIM_M = 0.06  # narrower than the hull: a cell counts as a whole
LOOKED_S = 20.0  # after the last reverse, a person's look is no longer valid
LOOKED_M = 1.5  # driven in any direction, turns included: beyond is other floor than the person saw
SLOWLY_BACK = Velocity(-0.1, 0.0, 0.0)


class Behind:
    """The floor that was looked at, and whether the robot may reverse."""

    def __init__(self, radius_m: float, brakes_mps2: float) -> None:
        """`radius_m`: of the hull, without the arm; `brakes_mps2`: the braking that the gate relies on."""
        self._radius_m = radius_m
        self._brakes_mps2 = brakes_mps2
        self._body = _disc(radius_m)
        self._rear = _rear(radius_m - RIM_M)
        self._cell = np.full((CELLS * CELLS, 2), np.iinfo(np.int64).min)
        self._until_s, self._until_m = np.full((2, CELLS * CELLS), -math.inf)
        self._odometer = Odometer()
        self._marked: tuple[Pose, float] | None = None
        self.forget_look()

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
        """Take that the depth camera looks: up to the first obstacle or hole of its picture in each direction."""
        if (sector := camera.sector) is None:
            return
        begins_m, ends_m = camera.table_range_m
        lens = camera.lens
        near_m = self._radius_m - math.hypot(*lens)
        bearings = np.arange(sector[0] - sector[1], sector[0] + sector[1], BEARING_RAD)
        ranges = np.arange(
            near_m if begins_m < near_m + TOP_M else begins_m, min(ends_m, SEEN_TO_M), 0.8 * CELL_M
        )
        x, y = (camera.columns - lens).T
        free_m = np.minimum(
            _nearest_m(np.arctan2(y, x), np.hypot(x, y), bearings), _nearest_m(*camera.measured, bearings)
        )
        bearing, range_m = np.meshgrid(bearings, ranges)
        visible = range_m < free_m[None, :]
        bearing, range_m = bearing[visible], range_m[visible]
        seen = from_columns(range_m * np.cos(bearing), range_m * np.sin(bearing)) + lens
        self._mark(placed(seen, pose), now_s)

    def forget(self) -> None:
        """Forget everything: the poses are in a new frame or doubtful, or a person asked for it."""
        self._until_s.fill(-math.inf)
        self._marked = None
        self._odometer.jump()
        self.forget_look()

    def forget_look(self) -> None:
        """Forget that a person has looked: another one drives."""
        self._refused_s = self._refused_m = -math.inf  # when and where reverse was last refused
        self._rested = False  # since then, no motion was asked
        self._looked_until_s = self._looked_to_m = -math.inf  # end of a person's look

    def doubt(self, doubt: Doubt) -> None:
        """Note that the robot's pose may be wrong by this much."""
        if doubt.metres > CERTAIN_M or doubt.radians > CERTAIN_RAD:
            self.forget()

    def rests(self) -> None:
        """Note that no motion is asked: reverse after this is a new request."""
        self._rested = True

    def forbids(self, wanted: Velocity, pose: Pose, now_s: float) -> bool:
        """Return whether this twist, from this pose, is a reverse to where nobody and nothing has looked.

        The same twist is allowed if it is asked anew within `LOOKED_S` after it was forbidden.
        """
        is_reverse = wanted.vx < 0.0 and abs(wanted.vy) <= -wanted.vx
        if not is_reverse or self._knows(wanted, pose, now_s):
            return False
        if self._rested and now_s - self._refused_s <= LOOKED_S:
            self._refused_s = -math.inf
            self._looked_until_s, self._looked_to_m = now_s, self._refused_m + LOOKED_M
        if self._is_looked_at(now_s):
            self._looked_until_s = now_s + LOOKED_S
            return False
        self._refused_s, self._refused_m, self._rested = now_s, self._travelled_m, False
        return True

    def warns(self, pose: Pose, now_s: float) -> bool:
        """Return whether a reverse from this pose would be forbidden."""
        return not (self._is_looked_at(now_s) or self._knows(SLOWLY_BACK, pose, now_s))

    def _is_looked_at(self, now_s: float) -> bool:
        """Return whether a person's look is valid."""
        return now_s <= self._looked_until_s and self._travelled_m <= self._looked_to_m

    def _knows(self, wanted: Velocity, pose: Pose, now_s: float) -> bool:
        """Return whether all of the way on which this robot would brake to standstill was looked at."""
        mps = math.hypot(wanted.vx, wanted.vy)
        way_m = max(mps * REACTS_S + mps**2 / (2.0 * self._brakes_mps2), WAY_M)
        ways_m = np.arange(STEP_M, way_m + STEP_M / 2.0, STEP_M)
        rears = np.concatenate([placed(self._rear, _along(wanted, mps, float(way_m))) for way_m in ways_m])
        cells, entries = _entries(placed(rears, pose))
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


def _along(wanted: Velocity, mps: float, way_m: float) -> Pose:
    """Return the pose (base frame) after this way with this twist, whose speed is `mps`."""
    turned = wanted.w * way_m / mps
    chord_m = way_m * float(np.sinc(turned / math.tau))
    heading = math.atan2(wanted.vy, wanted.vx) + turned / 2.0
    return Pose(chord_m * math.cos(heading), chord_m * math.sin(heading), turned)


def _entries(points: Points) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the cells of these points, and their entries in the grid, which moves with the robot."""
    cells = np.floor(points / CELL_M).astype(np.int64)
    wrapped = cells & (CELLS - 1)
    return cells, wrapped[:, 0] * CELLS + wrapped[:, 1]


def _nearest_m(
    towards: NDArray[np.float64], away_m: NDArray[np.float64], bearings: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the shortest of the distances `away_m`, with bearings `towards`, in each direction; infinite: none."""
    near = np.abs(towards[None, :] - bearings[:, None]) < BEARING_RAD
    nearest: NDArray[np.float64] = np.where(near, away_m[None, :], math.inf).min(axis=1, initial=math.inf)
    return nearest


def _disc(radius_m: float) -> Points:
    steps = np.arange(-radius_m, radius_m + CELL_M / 2.0, CELL_M / 2.0)
    x, y = (axis.ravel() for axis in np.meshgrid(steps, steps))
    inside = np.hypot(x, y) <= radius_m
    return from_columns(x[inside], y[inside])


def _rear(radius_m: float) -> Points:
    angles = np.linspace(math.pi - REAR_RAD, math.pi + REAR_RAD, 13)
    return from_columns(radius_m * np.cos(angles), radius_m * np.sin(angles))
