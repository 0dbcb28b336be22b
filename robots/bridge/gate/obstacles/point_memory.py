"""Memory of points that no sensor sees now (docs/gate.md, 7), in the odometry frame, for a limited time.

Two limits end the life of a point: the seconds since it was last seen, and the distance that the robot has
driven since then (a turn counts as some metres). The odometry's error grows with this distance, so the point is
moved nearer by the possible error, and by the motion that a gap of the odometry may hide. Points that were watched
for long have a long life. Points that were seen only briefly (noise, a person who walks by) have the shortest life.
Two observations of free space in a row end every life.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.sensing.scan import INSIDE_HULL_M
from robots.bridge.gate.timing.tremble import Odometer
from robots.bridge.gate.timing.unseen_motion import Doubt
from robots.shared.geometry.footprint import Footprint
from robots.shared.geometry.planar import NO_POINTS, ORIGIN, Points, chosen, from_columns, placed, relative_to
from robots.shared.geometry.poses import Pose

CELLS = 256  # along each side of the grid, a power of two: 6.4 m of 2.5 cm
PASSES = 2  # a point is forgotten after this many observations of free space at its place
GLANCES = 4  # ... or after this many observations of a place that is free only up to another obstacle near by
GAP_S = 0.2  # of the time between two sightings of a cell, at most this counts as watched
BRIEFLY_S = 0.6  # a point that was watched for no longer has the shortest life
LONG_S = 2.0  # a point that was watched for this time has the longest life
TURN_M = 0.5  # a turn by one radian counts as this distance
SURE_M = 1.0  # driven distance whose odometry error the margins cover: doors would be closed by it
ERROR_SHARE = 0.03  # odometry error for each further metre
MOST_ERROR_M = 0.10
KEEP_OFF_M = 0.03  # the error moves no point nearer to the hull than this
NEAR_LASTS = 2.0  # near points are kept for this many times the distance
NEWEST_SHARE = 0.2  # weight of the newest place in the mean of the places seen in a cell


class Layer(NamedTuple):
    """How long and how finely the memory keeps the points of one kind of sensor.

    A life counts from the last moment at which the point was seen, or near.
    """

    shortest_life_s: float
    longest_life_s: float
    travel_m: float
    # From the robot's middle: nearer points are not forgotten by time, and later by distance
    near_m: float = 0.0
    cell_m: float = 0.025


LASER_LAYER = Layer(2.0, 30.0, 6.0)
# A remembered place becomes wrong by driving, not by time: a table behind the robot is still there.
# A table top is out of view for long before the robot is past it.
DEPTH_LAYER = Layer(20.0, 90.0, 6.0, near_m=1.2)


def moved_nearer(points: Points, errors_m: NDArray[np.float64], footprint: Footprint) -> Points:
    """Return the points outside the hull (base frame), each nearer by its possible error, but not inside."""
    if not len(points):
        return points
    gaps = footprint.gaps(points)
    if not gaps.min() >= -INSIDE_HULL_M:
        outside = (gaps >= -INSIDE_HULL_M).nonzero()[0]
        points, errors_m, gaps = chosen(points, outside), errors_m.take(outside), gaps.take(outside)
    uncertain = errors_m.nonzero()[0]
    if not len(uncertain):
        return points
    x, y = points.T
    uncertain_x, uncertain_y = x.take(uncertain), y.take(uncertain)
    nearer_m = np.minimum(errors_m.take(uncertain), np.maximum(gaps.take(uncertain) - KEEP_OFF_M, 0.0))
    nearer_m /= np.maximum(np.sqrt(uncertain_x * uncertain_x + uncertain_y * uncertain_y), KEEP_OFF_M)
    share = 1.0 - nearer_m
    nearer = points.T.copy()
    nearer[0, uncertain] = share * uncertain_x
    nearer[1, uncertain] = share * uncertain_y
    return nearer.T


def outside_robot(places: Points, base: Pose | None, footprint: Footprint) -> Points:
    """Return the places (odometry frame) outside the hull of a robot at `base`: places inside are wrong."""
    if base is None or not len(places):
        return NO_POINTS
    gaps = footprint.gaps(placed(places, relative_to(ORIGIN, base)))
    return chosen(places, np.flatnonzero(gaps >= -INSIDE_HULL_M))


class Memory:
    """One layer: a grid that moves with the robot, with at most one point in each cell.

    Its arrays have a fixed size; their index is the cell's coordinates modulo `CELLS`. No two remembered
    points share an entry, because points more than `reach_m` away from the robot along x or y are forgotten
    first.
    """

    def __init__(self, layer: Layer) -> None:
        self._layer = layer
        self.reach_m = (CELLS / 2 - 1) * layer.cell_m
        self._x, self._y, self._watched_s, self._seen_s, self._expires_s, self._expires_m = np.zeros(
            (6, CELLS * CELLS)
        )
        # Error by gaps of the odometry since the point was last seen
        self._doubts_m = np.zeros(CELLS * CELLS)
        self._passes = np.zeros(CELLS * CELLS, dtype=np.int8)
        self._lives = np.zeros(CELLS * CELLS, dtype=np.bool_)
        # working memory: which of several points in a cell is last
        self._order = np.zeros(CELLS * CELLS, dtype=np.int32)
        # the entries that live, in order of `points`
        self._cells: NDArray[np.intp] = np.empty(0, dtype=np.intp)
        self._odometer = Odometer()
        self._travelled_m = 0.0
        self._points: Points | None = None
        self._first_expiry_s = math.inf
        self._revision = 0

    # --- state ----------------------------------------------------------------------------------

    @property
    def is_empty(self) -> bool:
        """Return whether nothing is remembered."""
        return not len(self._cells)

    def revision(self, now_s: float) -> int:
        """Return a number that changes whenever `points` change."""
        self._expire(now_s)
        return self._revision

    def points(self, now_s: float) -> Points:
        """Return the remembered points, odometry frame. Rows keep their order until `revision` changes."""
        self._expire(now_s)
        if self._points is None:
            self._points = from_columns(self._x.take(self._cells), self._y.take(self._cells))
        return self._points

    def errors_m(self, rows: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the possible error of some of `points` since they were last seen, metres."""
        cells = self._cells.take(rows)
        moved_m = self._travelled_m + self._layer.travel_m - self._expires_m.take(cells)
        errors_m: NDArray[np.float64] = ERROR_SHARE * (moved_m - SURE_M)  # np.clip costs more
        errors_m = np.minimum(np.maximum(errors_m, 0.0), MOST_ERROR_M)
        errors_m += self._doubts_m.take(cells)
        return errors_m

    def doubts_m(self) -> NDArray[np.float64]:
        """Return the part of the possible error of `points` that comes from gaps of the odometry, metres."""
        return self._doubts_m.take(self._cells)

    def entries(self, points: Points) -> NDArray[np.intp]:
        """Return the entries of these places' cells; within the memory's reach each cell has its own."""
        if points is self._points:  # a frequent case: all remembered points
            return self._cells
        x, y = points.T
        column = np.floor(x / self._layer.cell_m).astype(np.intp) & (CELLS - 1)
        row = np.floor(y / self._layer.cell_m).astype(np.intp) & (CELLS - 1)
        entries: NDArray[np.intp] = column * CELLS + row
        return entries

    # --- input ----------------------------------------------------------------------------------

    def follow(self, pose: Pose, now_s: float) -> None:
        """Move the robot to `pose` (odometry frame). Forget points by age, distance and driven distance."""
        self._odometer.follow(pose)
        self._travelled_m = self._odometer.driven_m + TURN_M * self._odometer.turned_rad
        cells = self._cells
        away = np.maximum(np.abs(self._x[cells] - pose.x), np.abs(self._y[cells] - pose.y))
        far, is_near = away > self.reach_m, away < self._layer.near_m
        near = cells[is_near]
        self._expires_s[near] = np.maximum(self._expires_s[near], now_s + self._layer.shortest_life_s)
        lasts_m = self._expires_m[cells] + is_near * (NEAR_LASTS - 1.0) * self._layer.travel_m
        self.forget(far | (self._expires_s[cells] < now_s) | (lasts_m < self._travelled_m))

    def see(self, points: Points, pose: Pose, now_s: float) -> None:
        """Store `points` (odometry frame) that the robot at `pose` sees now.

        A cell keeps the mean of the places seen in it; newer places have more weight. Without the mean, a
        point that leaves the view would keep its last noise, and a wall that the robot passes closely would
        block the way.
        """
        self.follow(pose, now_s)
        x, y = points.T
        near = np.maximum(np.abs(x - pose.x), np.abs(y - pose.y)) <= self.reach_m
        x, y = x[near], y[near]
        if not len(x):
            return
        cells, kept = self._one_per_cell(self.entries(from_columns(x, y)))
        known = self._lives[cells]
        watched_s = np.minimum(now_s - self._seen_s[cells], GAP_S)
        watched_s = np.where(known, self._watched_s[cells] + watched_s, 0.0)
        share = np.where(known, NEWEST_SHARE, 1.0)
        self._x[cells] += share * (x[kept] - self._x[cells])
        self._y[cells] += share * (y[kept] - self._y[cells])
        self._watched_s[cells] = watched_s
        self._seen_s[cells] = now_s
        self._expires_s[cells] = now_s + self._life_s(watched_s)
        self._expires_m[cells] = self._travelled_m + self._layer.travel_m
        self._doubts_m[cells] = 0.0
        self._passes[cells] = 0
        self._lives[cells] = True
        self._cells = np.concatenate((self._cells, cells[~known]))
        self._changed()

    def doubt(self, doubt: Doubt, pose: Pose) -> None:
        """Take a gap of the odometry: the robot at `pose` may be elsewhere, and so may all points."""
        cells = self._cells
        self._doubts_m[cells] += doubt.at(np.hypot(self._x[cells] - pose.x, self._y[cells] - pose.y))
        self._changed()

    def knows(self, points: Points) -> NDArray[np.bool_]:
        """Return which points (odometry frame, within reach) have a remembered point in their cell."""
        known: NDArray[np.bool_] = self._lives[self.entries(points)]
        return known

    def pass_through(self, free: NDArray[np.bool_], past: NDArray[np.bool_] | None = None) -> None:
        """Take an observation of free space at these of `points`; the second one in a row forgets them.

        `past`: a sensor looked past these to something near by, probably to the same obstacle, which the odometry's
        error displaced; the fourth such observation in a row forgets them. A new sighting of the point restarts the
        count.
        """
        counts = free * (GLANCES // PASSES)
        if past is not None:
            counts = np.maximum(counts, past)
        self._passes[self._cells] += counts.astype(np.int8)
        self.forget(self._passes[self._cells] >= GLANCES)

    def forget(self, gone: NDArray[np.bool_]) -> None:
        """Forget these of `points` at once."""
        if not gone.any():
            return
        self._lives[self._cells[gone]] = False
        self._cells = self._cells[~gone]
        self._changed()

    def clear(self) -> None:
        """Forget everything: the odometry frame is a new one."""
        self._odometer.jump()
        self.forget(np.ones(len(self._cells), dtype=np.bool_))

    # --- within -------------------------------------------------------------------------------

    def _one_per_cell(self, cells: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return each cell once, and the number of the last point in it."""
        numbers = np.arange(len(cells), dtype=np.int32)
        self._order[cells] = numbers
        kept = np.flatnonzero(self._order[cells] == numbers)
        return cells[kept], kept

    def _life_s(self, watched_s: NDArray[np.float64]) -> NDArray[np.float64]:
        shortest, longest = self._layer.shortest_life_s, self._layer.longest_life_s
        life_s = shortest + (longest - shortest) / (LONG_S - BRIEFLY_S) * (watched_s - BRIEFLY_S)
        return np.minimum(np.maximum(life_s, shortest), longest)

    def _expire(self, now_s: float) -> None:
        if self._first_expiry_s < now_s:
            self.forget(self._expires_s[self._cells] < now_s)

    def _changed(self) -> None:
        self._points = None
        self._first_expiry_s = float(self._expires_s[self._cells].min(initial=math.inf))
        self._revision += 1
