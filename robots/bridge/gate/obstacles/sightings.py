"""Check remembered places against a scan: hit, seen through, or no answer (docs/gate.md, 7)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.sensing.scan import Sweep
from robots.shared.geometry.planar import Points, chosen, from_columns, wrapped

BEHIND_M = 0.12  # beams that end this far behind a place passed through it
PAST_M = 0.015  # steadied beams that end this far behind a place hit nothing there: more than a laser's noise
SAME_M = 0.10  # a beam that ends less than this before a place may have hit the obstacle there

SHARES = (-1.0, -0.75, -0.5, -0.25, 0.25, 0.5, 0.75, 1.0)  # of an error: places that are checked, too
NEAREST_M = 0.05  # least distance for which a direction is computed


class Sight(NamedTuple):
    """For each place, whether this scan can judge it (`judged`), and whether the scan saw through it.

    `past`: the scan saw past it, but perhaps only to another part of the same obstacle.
    """

    judged: NDArray[np.bool_]
    through: NDArray[np.bool_]
    past: NDArray[np.bool_]


class Past(NamedTuple):
    """Least distance (m) behind each place at which the nearest three beams end; -inf if one is unknown.

    A beam that hit something alone (probably noise) counts as unknown in `likely`, but not in `surely`.
    """

    surely: NDArray[np.float64]
    likely: NDArray[np.float64]


def sight(sweep: Sweep, places: Points) -> Sight:
    """Return which of `places` (sensor's frame) the scan can judge, and which it saw through.

    It cannot judge places outside the field of view, behind a hit, or where one of the three nearest beams
    measured nothing. A beam that hit something alone is probably noise and proves nothing. But if all three
    beams end well behind a place, the scan saw through it.
    """
    beams, distances = _looked_at(sweep, places)
    through = sweep.least_ends[beams] - distances > BEHIND_M
    likely = sweep.least_sure_ends[beams] - distances
    past = sweep.least_steadied_ends[beams] - distances > PAST_M
    return Sight(through | (likely >= -SAME_M), through, past)


def sight_of_doubtful(sweep: Sweep, places: Points, doubts_m: NDArray[np.float64]) -> Sight:
    """Return `sight` of places with possible errors: what holds for all places within the error."""
    seen = sight(sweep, places)
    rows = doubts_m.nonzero()[0]
    if not len(rows):
        return seen
    doubtful, doubts_m = chosen(places, rows), doubts_m.take(rows)
    seen.through[rows] &= seen_free(sweep, beyond(doubtful, doubts_m))
    seen.past[rows] = False
    for aside in beside(doubtful, doubts_m):
        there = sight(sweep, aside)
        seen.judged[rows] &= there.judged
        seen.through[rows] &= there.through
    return seen


def past(sweep: Sweep, places: Points) -> Past:
    """Return how far behind `places` (sensor's frame) the beams end."""
    beams, distances = _looked_at(sweep, places)
    return Past(sweep.least_ends[beams] - distances, sweep.least_sure_ends[beams] - distances)


def seen_free(sweep: Sweep, places: Points) -> NDArray[np.bool_]:
    """Return only `through` of `sight`, at a lower cost."""
    beams, distances = _looked_at(sweep, places)
    free: NDArray[np.bool_] = sweep.least_ends[beams] - distances > BEHIND_M
    return free


def beside(places: Points, doubts_m: NDArray[np.float64]) -> Iterator[Points]:
    """Return the same places, shifted by shares of their possible errors across the sensor's view.

    `places` in the sensor's frame. A sensor judges a place whose error is known only if it judges these, too: the
    obstacle may be outside its view.
    """
    x, y = places.T
    far = np.maximum(np.sqrt(x * x + y * y), NEAREST_M)
    for share in SHARES:
        aside = share * doubts_m / far
        yield from_columns(x - aside * y, y + aside * x)


def beyond(places: Points, doubts_m: NDArray[np.float64]) -> Points:
    """Return the places (sensor's frame), each farther away by its possible error."""
    far = np.maximum(np.hypot(*places.T), NEAREST_M)
    farther: Points = places * (1.0 + doubts_m / far)[:, None]
    return farther


def _looked_at(sweep: Sweep, places: Points) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the beam nearest to each of `places`, and the distance of the place."""
    x, y = places.T
    return beams_at(sweep, np.arctan2(y, x)), np.sqrt(x * x + y * y)


def beams_at(sweep: Sweep, bearings: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the beam nearest to each bearing (-pi..pi); out of view, the number of beams."""
    beams = len(sweep.ranges)
    turned = (bearings - wrapped(sweep.angle_min)) * math.copysign(1.0, sweep.increment)
    turned += math.tau * (turned < 0.0)
    nearest = (turned / abs(sweep.increment) + 0.5).astype(np.intp)
    return nearest % beams if sweep.is_full_circle else np.minimum(nearest, beams)
