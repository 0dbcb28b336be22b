"""From laser and sonar measurements to points in the base frame (docs/gate.md, 8)."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots.shared.configuration.gate_profile import MOST_BEAMS
from robots.shared.geometry.footprint import Footprint
from robots.shared.geometry.planar import NO_POINTS, Points, from_columns, placed, wrapped
from robots.shared.geometry.poses import Pose
from robots.shared.sentences import say

NEIGHBOUR_BEAMS = 2
NEIGHBOUR_M = 0.10
SAME_SURFACE_M = 0.05  # neighbouring beams that differ by less hit the same surface
INSIDE_HULL_M = 0.03  # points deeper than this in the hull are the robot itself
FINEST_RAD = 1e-5  # between two beams; with less, beam numbers overflow
LEAST_KNOWN_SHARE = 0.5  # of the beams of a scan, or of a part of it; with fewer it proves nothing
CONE_POINTS = 9  # points on an echo's arc: 6 cm apart over a cone of 0.5 rad at 1 m


class Malformed(ValueError):
    """A measurement that is not valid, with the reason in words."""


class Sweep:
    """The geometry of one scan: beam i points to `angle_min + i * increment` in the sensor's frame."""

    def __init__(
        self, ranges: Any, angle_min: float, increment: float, range_min_m: float, range_max_m: float
    ) -> None:
        """Check all values; raise Malformed if the scan is not valid."""
        try:
            self.ranges = np.asarray(ranges, dtype=np.float64)
            numbers = [float(number) for number in (angle_min, increment, range_min_m, range_max_m)]
        except (TypeError, ValueError, OverflowError) as error:
            raise Malformed(say("its scans are not numbers")) from error
        self.angle_min, self.increment, self.range_min_m, self.range_max_m = numbers
        self._check()

    def _check(self) -> None:
        if self.ranges.ndim != 1 or not 2 <= len(self.ranges) <= MOST_BEAMS:
            raise Malformed(say("its scans have no beams, or far too many"))
        if not (abs(self.angle_min) <= math.tau and FINEST_RAD <= abs(self.increment) <= math.pi / 2.0):
            raise Malformed(say("the angles of its scans are not valid"))
        if self.span > math.tau + 2.0 * abs(self.increment):
            raise Malformed(say("its scans cover more than a full circle"))
        if not 0.0 <= self.range_min_m < self.range_max_m:
            raise Malformed(say("the range limits of its scans are not valid"))
        if self.known.mean() < LEAST_KNOWN_SHARE:
            raise Malformed(say("most of its beams measure nothing"))

    @property
    def span(self) -> float:
        """Angle between the first and the last beam, radians."""
        return abs(self.increment) * (len(self.ranges) - 1)

    @property
    def middle(self) -> float:
        """Angle of the middle beam in the sensor's frame."""
        return self.angle_min + self.increment * (len(self.ranges) - 1) / 2.0

    @property
    def is_full_circle(self) -> bool:
        """Return whether the last beam is next to the first."""
        return self.span + 1.5 * abs(self.increment) > math.tau

    @cached_property
    def ends(self) -> NDArray[np.float64]:
        """Return how far each beam surely reached: +inf is free; NaN and ranges out of bounds give -inf.

        A range of -inf means nearer than `range_min_m`, and counts as `range_min_m`.
        """
        ends = np.where(np.isneginf(self.ranges), self.range_min_m, self.ranges)
        known = (ends >= self.range_min_m) & ((ends < self.range_max_m) | np.isposinf(ends))
        return np.where(known, ends, -math.inf)

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """Beams that measured an obstacle or free space.

        A range below `range_min_m` is neither: lasers send 0 if they cannot measure or are covered.
        """
        return ~np.isneginf(self.ends)

    def looks_to(self, angle: float, half_width: float) -> bool:
        """Return whether an angle (sensor's frame) is in view and most beams around it measured something."""
        beams = (wrapped(angle - self.middle) + self.span / 2.0) / abs(self.increment)
        half = half_width / abs(self.increment)
        if not -0.5 <= beams <= len(self.ranges) - 0.5:
            return False
        first, end = max(int(beams - half), 0), min(int(beams + half) + 1, len(self.ranges))
        if self.increment < 0.0:
            first, end = len(self.ranges) - end, len(self.ranges) - first
        known = int(self._known_before[end] - self._known_before[first])
        return known >= LEAST_KNOWN_SHARE * (end - first)

    @cached_property
    def _known_before(self) -> NDArray[np.intp]:
        """Return the number of known beams before each beam, and at the end the number of all known beams."""
        return np.concatenate(([0], np.cumsum(self.known)))

    @cached_property
    def alone(self) -> NDArray[np.bool_]:
        """Beams with a hit but without a neighbour at a similar range: probably noise."""
        return np.isfinite(self.ends) & ~has_neighbour(self._hits, self._steps)

    @cached_property
    def _hits(self) -> NDArray[np.float64]:
        """Return the ranges of the beams that hit something, NaN for the others."""
        return np.where(np.isfinite(self.ends), self.ends, np.nan)

    @cached_property
    def _steps(self) -> list[NDArray[np.float64]]:
        """Return the range differences of neighbouring beams."""
        return differences(self._hits)

    @cached_property
    def least_ends(self) -> NDArray[np.float64]:
        """The shortest `ends` of each beam and its two neighbours, and one more entry for points out of view."""
        return self._least_of_three(self.ends)

    @cached_property
    def least_sure_ends(self) -> NDArray[np.float64]:
        """The same, but with -inf for the beams in `alone`."""
        return self._least_of_three(np.where(self.alone, -math.inf, self.ends))

    def _least_of_three(self, ends: NDArray[np.float64]) -> NDArray[np.float64]:
        least = np.full(len(ends) + 1, -math.inf)
        np.minimum(np.minimum(ends[:-2], ends[1:-1]), ends[2:], out=least[1:-2])
        if self.is_full_circle:
            least[0] = min(ends[-1], ends[0], ends[1])
            least[-2] = min(ends[-2], ends[-1], ends[0])
        return least

    def points(self) -> Points:
        """Return the hits in the sensor's frame."""
        return self._at(self.ends)

    def steadied(self) -> Points:
        """Return `points`, with each range averaged over neighbouring beams that hit the same surface.

        Without the average, noise would narrow every door, because the nearest points count, and memory would
        keep the error. To compare scans, use `points`: near an edge, an average may be at a place where
        nothing is.
        """
        return self._at(self._steadied)

    @cached_property
    def least_steadied_ends(self) -> NDArray[np.float64]:
        """The same as `least_sure_ends`, by the ranges of `steadied`."""
        ends = np.where(np.isnan(self._steadied), self.ends, self._steadied)
        return self._least_of_three(np.where(self.alone, -math.inf, ends))

    @cached_property
    def _steadied(self) -> NDArray[np.float64]:
        """Return the ranges of the beams that hit something, averaged as in `steadied`; NaN for the others."""
        hits = self._hits
        total, count = hits.copy(), np.ones(len(hits))
        for beams, steps in enumerate(self._steps, 1):
            low, high = hits[:-beams], hits[beams:]
            same = steps < SAME_SURFACE_M
            total[:-beams] += np.where(same, high, 0.0)
            total[beams:] += np.where(same, low, 0.0)
            count[:-beams] += same
            count[beams:] += same
        steadied: NDArray[np.float64] = total / count
        return steadied

    def _at(self, ranges: NDArray[np.float64]) -> Points:
        """Return the ends of the beams that hit something, for these ranges of all beams."""
        kept, cos, sin = self._rays
        ends = ranges.take(kept)
        return from_columns(ends * cos, ends * sin)

    @cached_property
    def _rays(self) -> tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.float64]]:
        """The beams that hit something, not alone, and the cosines and sines of their angles."""
        kept = np.flatnonzero(np.isfinite(self.ends) & ~self.alone)
        angles = self.angle_min + self.increment * kept
        return kept, np.cos(angles), np.sin(angles)


def differences(hits: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return how much each beam differs from the next one, from the one after that, and so on."""
    return [np.abs(hits[beams:] - hits[:-beams]) for beams in range(1, NEIGHBOUR_BEAMS + 1)]


def has_neighbour(hits: NDArray[np.float64], steps: list[NDArray[np.float64]]) -> NDArray[np.bool_]:
    """Return the beams with another hit within two beams and 10 cm of range: a thin leg has one, noise none.

    `hits`: NaN is no hit. `steps`: the `differences`. The last beam counts as a neighbour of the first: this
    is true on a full circle, and elsewhere it only keeps more beams.
    """
    kept = np.zeros(len(hits), dtype=np.bool_)
    for beams, step in enumerate(steps, 1):
        close = step < NEIGHBOUR_M
        kept[beams:] |= close
        kept[:-beams] |= close
        around = np.abs(hits[:beams] - hits[-beams:]) < NEIGHBOUR_M
        kept[:beams] |= around
        kept[-beams:] |= around
    return kept


def outside_hull(points: Points, footprint: Footprint) -> Points:
    """Return the points that are not the robot's own body."""
    if not len(points):
        return points
    outside = footprint.gaps(points) >= -INSIDE_HULL_M
    return points if outside.all() else points.T[:, outside].T


def cone_points(range_m: float, max_range_m: float, pose: Pose, fov: float) -> Points:
    """Return the possible places of an echo: an arc across the sonar's cone, base frame.

    No points at or beyond `max_range_m`; -inf is directly at the sensor. Raises Malformed if the range is not
    valid.
    """
    if math.isnan(range_m) or (range_m < 0.0 and not math.isinf(range_m)):
        raise Malformed(say("its ranges are not valid"))
    if range_m >= max_range_m or range_m == math.inf:
        return NO_POINTS
    angles = np.linspace(-fov / 2.0, fov / 2.0, CONE_POINTS)
    range_m = max(range_m, 0.0)
    return placed(from_columns(range_m * np.cos(angles), range_m * np.sin(angles)), pose)
