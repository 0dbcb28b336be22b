"""Arrivals: things that stand where earlier scans of the same laser saw free space (docs/gate.md, 10).

A walking person is two shins, of which one stands while the other swings. So within the time of one step, a
shin alone looks like furniture. Within a stride each shin has come to a place that was free before. The newest
scan is compared with several earlier ones, as old as a stride. Changes by the robot's own motion, at edges and by
occlusion prove nothing and are ignored. Places are in the odometry frame; times are the robot's own stamps.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.obstacles.sightings import BEHIND_M, beams_at
from robots.bridge.gate.sensing.scan import Sweep
from robots.shared.geometry.planar import ORIGIN, Points, placed, relative_to, wrapped
from robots.shared.geometry.poses import Pose

NEAR_M = 4.5  # a thing farther from the sensor cannot reach the robot before it stands; farther legs flicker
AGES_S = (0.07, 0.15, 0.3, 0.5, 0.8, 1.15)  # of the scans to compare with; the last is a slow person's stride
OLDEST_S = 1.4
LEAST_FREE = 2  # scans that saw a place free, so that it surely was
LEAST_POINTS = 2  # of an arrival: a shin 4 m away, or a child's
APART_M = 0.15  # between two neighbouring points of different things
LEAST_SHARE = 0.5  # of the points of a thing: at edges of standing things, single points seem new
MANY = 4  # points that are an arrival, even if they touch a standing thing
# A thing near the sensor came if one scan saw its place free: it may be in view only now. It has this many points, and
# older scans than this saw nothing there: thin legs are missed in some scans.
LIKELY_M, LIKELY_POINTS, LIKELY_S = 3.0, 3, 0.25
# Errors of the odometry between two scans: by time, by turn, by way; and along a scan while the robot turns.
DRIFT_RADPS, DRIFT_PER_RAD, DRIFT_PER_M = 0.02, 0.05, 0.03
SWEEP_S = 0.03  # the ends of a scan are this much older or younger than its middle
LEAST_RAD = 0.006

Flags = NDArray[np.bool_]


class Arrival(NamedTuple):
    """A thing that arrived: its middle, its radius, and how many beams hit it."""

    x: float
    y: float
    radius_m: float
    beams: int


class Look:
    """One scan: its stamp, the pose of its sensor, and its points near the sensor, in the order of the beams."""

    def __init__(self, stamp_s: float, sensor: Pose, sweep: Sweep, hit: Callable[[], Points]) -> None:
        self.stamp_s = stamp_s
        self.sensor = sensor
        self.sweep = sweep
        self._hit = hit

    @cached_property
    def points(self) -> Points:
        """Near points, odometry frame."""
        points = self._hit()
        x, y = points.T
        near = np.flatnonzero(np.hypot(x - self.sensor.x, y - self.sensor.y) < NEAR_M)
        return points.T[:, near].T

    @cached_property
    def _ends(self) -> NDArray[np.float64]:
        """How far each beam surely reached. A single lost beam reached as far as its neighbours."""
        ends = self.sweep.ends
        filled = ends.copy()
        lost = np.isneginf(ends[1:-1])
        filled[1:-1][lost] = np.minimum(ends[:-2], ends[2:])[lost]
        return filled

    def saw(self, places: Points, tolerance: float) -> tuple[Flags, Flags]:
        """Return which places this scan saw free, and at which something stood.

        `tolerance`: possible error of the sensor's heading.
        """
        around = math.ceil(tolerance / abs(self.sweep.increment)) + 1
        x, y = placed(places, relative_to(ORIGIN, self.sensor)).T
        beams, away = beams_at(self.sweep, np.arctan2(y, x)), np.sqrt(x * x + y * y)
        beyond = np.append(_least_about(self._ends, around), -math.inf)[beams] - away
        return beyond > BEHIND_M, np.abs(beyond) <= BEHIND_M

    def has_hit(self, x: float, y: float, radius_m: float) -> bool:
        """Return whether a point lies within a disc."""
        return bool((np.hypot(self.points[:, 0] - x, self.points[:, 1] - y) < radius_m).any())

    def tolerance_to(self, other: Look) -> float:
        """Return by how much (rad) the odometry may misjudge a bearing from this scan to a later one."""
        passed_s = other.stamp_s - self.stamp_s
        turned = abs(wrapped(other.sensor.yaw - self.sensor.yaw))
        moved_m = math.hypot(other.sensor.x - self.sensor.x, other.sensor.y - self.sensor.y)
        drifted = DRIFT_RADPS * passed_s + DRIFT_PER_RAD * turned + DRIFT_PER_M * moved_m
        return LEAST_RAD + drifted + SWEEP_S * turned / passed_s


class Arrivals:
    """Compares the newest scan of one laser with its earlier scans."""

    def __init__(self) -> None:
        self._looks: deque[Look] = deque()

    def forget(self) -> None:
        """Forget all scans."""
        self._looks.clear()

    def observe(self, look: Look) -> list[Arrival]:
        """Take the newest scan; return what arrived."""
        looks = self._looks
        while looks and look.stamp_s - looks[0].stamp_s > OLDEST_S:
            looks.popleft()
        before = (
            [looks[n] for n in sorted({self._nearest(look.stamp_s - age_s) for age_s in AGES_S})]
            if looks
            else []
        )
        looks.append(look)
        points = look.points
        if not before or not len(points):
            return []
        return list(_things(points, *_came(points, look, before)))

    def _nearest(self, stamp_s: float) -> int:
        looks = self._looks
        return min(range(len(looks)), key=lambda n: abs(looks[n].stamp_s - stamp_s))


def _came(points: Points, look: Look, before: list[Look]) -> tuple[Flags, Flags]:
    """Return which points of a scan stand where earlier scans (oldest first) saw free space: surely, and likely.

    Likely: one scan is enough, near the sensor. A thin leg is missed in some scans. So a thing did not come if the
    oldest scan that shows its place had something there, or if a scan missed what an older one had.
    """
    free = np.zeros(len(points), dtype=np.intp)
    known, hits, lasting, stood = np.zeros((4, len(points)), dtype=np.bool_)
    for earlier in before:
        through, hit = earlier.saw(points, earlier.tolerance_to(look))
        free += through
        stood |= (hit & ~known) | (through & hits)
        known |= hit | through
        hits |= hit
        if look.stamp_s - earlier.stamp_s > LIKELY_S:
            lasting |= hit
    surely: Flags = ~stood & (free >= LEAST_FREE)
    near = np.hypot(points[:, 0] - look.sensor.x, points[:, 1] - look.sensor.y) < LIKELY_M
    return surely, surely | (near & ~stood & ~lasting & (free > 0))


def _things(points: Points, surely: Flags, likely: Flags) -> Iterator[Arrival]:
    """Return the things that came: most of their points, some of them surely, or many likely."""
    if np.count_nonzero(likely) < LEAST_POINTS:
        return
    steps = np.hypot(*np.diff(points, axis=0).T)
    starts = np.concatenate(([0], np.flatnonzero(steps > APART_M) + 1, [len(points)]))
    sure, counts = (np.add.reduceat(came, starts[:-1], dtype=np.intp) for came in (surely, likely))
    for n in np.flatnonzero((sure >= LEAST_POINTS) | (counts >= LIKELY_POINTS)):
        rows = np.arange(starts[n], starts[n + 1])
        some = points[rows[likely[rows]]]
        if len(some) < LEAST_SHARE * len(rows) and len(some) < MANY:
            continue
        x, y = some.mean(axis=0).tolist()
        yield Arrival(x, y, float(np.hypot(*np.ptp(some, axis=0))) / 2.0, len(some))


def _least_about(ends: NDArray[np.float64], beams: int) -> NDArray[np.float64]:
    """Return the least end of each beam and its neighbours, `beams` to either side."""
    least, reach = ends, 0
    while reach < beams:
        step = min(2 * reach + 1, beams - reach)
        grown = least.copy()
        np.minimum(grown[step:], least[:-step], out=grown[step:])
        np.minimum(grown[:-step], least[step:], out=grown[:-step])
        least, reach = grown, reach + step
    return least
