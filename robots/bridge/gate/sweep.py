"""The space that the arm sweeps in a motion, seen from above, and what stands in it. Base frame, metres, radians."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.posture import UNDER_M, Disc
from robots.bridge.gate.values import Obstacles

STEP = 0.1  # rad or m between two looks at the arm on its way
CELL_M = 0.05
_CORNER_M = CELL_M * math.sqrt(0.5)  # no disc's middle is farther than this from the middle of its cell

DiscsAt = Callable[[Mapping[str, float]], Sequence[Disc]]  # of the arm, with its joints in these positions


class Motion(NamedTuple):
    """A recorded motion: one position for each joint at each point."""

    joints: tuple[str, ...]
    points: tuple[tuple[float, ...], ...]


class Intruder(NamedTuple):
    """What stands where the arm would be: its source's row in `Obstacles.names`, and how far it is from the base."""

    source: int
    gap_m: float
    bearing: float


def swept(motion: Motion, present: Mapping[str, float], discs_at: DiscsAt) -> tuple[Disc, ...]:
    """The discs of the arm on its way from where it is through all points of the motion, joints in step.

    KeyError: `present` lacks a joint.
    """
    way = [tuple(present[joint] for joint in motion.joints), *motion.points]
    discs: list[Disc] = []
    for begin, end in pairwise(way):
        for positions in _between(begin, end):
            discs += discs_at({**present, **dict(zip(motion.joints, positions, strict=True))})
    return thinned(discs)


def _between(begin: Sequence[float], end: Sequence[float]) -> Iterable[tuple[float, ...]]:
    """Both ends, and as much between them that no joint moves more than a step at a time."""
    steps = max(1, math.ceil(max(abs(b - a) for a, b in zip(begin, end, strict=True)) / STEP))
    for step in range(steps + 1):
        share = step / steps
        yield tuple(a + share * (b - a) for a, b in zip(begin, end, strict=True))


def thinned(discs: Iterable[Disc]) -> tuple[Disc, ...]:
    """At most one disc a cell: it covers all those that have their middle there."""
    largest: dict[tuple[int, int], float] = {}
    for x, y, radius in discs:
        cell = (round(x / CELL_M), round(y / CELL_M))
        largest[cell] = max(radius, largest.get(cell, 0.0))
    return tuple((i * CELL_M, j * CELL_M, radius + _CORNER_M) for (i, j), radius in largest.items())


def intruder(
    discs: Sequence[Disc], obstacles: Obstacles, gaps: NDArray[np.float64], arm: Sequence[Disc] = ()
) -> Intruder | None:
    """What is nearest to the base (`gaps`, one for each obstacle) of all that the arm would sweep.

    What is well within the arm as it is now (`arm`) is above it, below it, or the arm itself.
    """
    inside = (_depth(discs, obstacles.points) >= 0.0) & (_depth(arm, obstacles.points) < UNDER_M)
    rows = np.flatnonzero(inside)
    if not len(rows):
        return None
    row = rows[np.argmin(gaps[rows])]
    x, y = obstacles.points[row]
    return Intruder(int(obstacles.source[row]), float(gaps[row]), math.atan2(y, x))


def _depth(discs: Sequence[Disc], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """How deep each point is within the union of the discs; negative: that far outside."""
    deepest = np.full(len(points), -math.inf)
    for x, y, radius in discs:
        np.maximum(deepest, radius - np.hypot(points[:, 0] - x, points[:, 1] - y), out=deepest)
    return deepest
