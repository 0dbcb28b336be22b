"""The space that the arm sweeps in a motion, seen from above, and obstacles in it. Base frame, metres, radians."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.arm.discs import UNDER_M, Disc, covering_m, middles_along
from robots.bridge.gate.values import Obstacles

STEP = 0.05  # rad and m, of all joints together, between two checked postures
CELL_M = 0.05
_CORNER_M = CELL_M * math.sqrt(0.5)  # no disc's middle is farther than this from the middle of its cell

Floats = NDArray[np.float64]
# Places of the links (moments, links, 2 or 3), from the joints at these moments
LinksAt = Callable[[Mapping[str, float | Floats]], Floats]


class Motion(NamedTuple):
    """A recorded motion: one position for each joint at each point."""

    joints: tuple[str, ...]
    points: tuple[tuple[float, ...], ...]


class Intruder(NamedTuple):
    """The obstacle in the arm's path: row of its source in `Obstacles.names`, distance to the base."""

    source: int
    gap_m: float
    bearing_rad: float


def swept(
    motion: Motion,
    present: Mapping[str, float],
    links_at: LinksAt,
    radius_m: float,
    ends: Sequence[int] = (),
    end_m: float = 0.0,
) -> tuple[Disc, ...]:
    """Return discs that cover an arm of this radius from `present` through all points of the motion.

    All joints move in step. The arm may reach `end_m` farther from the links with the numbers `ends`: their
    parts are missing in the robot's description. Raises KeyError if `present` lacks a joint.
    """
    joints = np.array([[present[joint] for joint in motion.joints], *motion.points])
    moments = np.concatenate([_between(begin, end) for begin, end in pairwise(joints)])
    lines = links_at({**present, **dict(zip(motion.joints, moments.T, strict=True))})[..., :2]
    jumps = np.hypot(*np.moveaxis(np.diff(lines, axis=0), -1, 0))
    between_m = float(jumps.max()) / 2.0
    discs = thinned(middles_along(lines, radius_m), covering_m(radius_m) + between_m)
    if end_m == 0.0:
        return discs
    return discs + thinned(lines[:, ends].reshape(-1, 2), radius_m + end_m + between_m)


def _between(begin: Floats, end: Floats) -> Floats:
    """Return both ends and enough postures between them: from one to the next, joints move `STEP` at most."""
    steps = max(1, math.ceil(float(np.abs(end - begin).sum()) / STEP))
    return np.linspace(begin, end, steps + 1)


def thinned(middles: Floats, radius_m: float) -> tuple[Disc, ...]:
    """Return one disc for each cell: it covers all discs of this radius with their middle (N, 2) there."""
    columns, rows = np.rint(middles / CELL_M).astype(np.int64).T
    cells = np.unique((columns << 32) + rows)
    rows = (cells + (1 << 31) & 0xFFFFFFFF) - (1 << 31)
    columns = (cells - rows) >> 32
    places = CELL_M * np.stack((columns, rows), axis=1)
    return tuple((x, y, radius_m + _CORNER_M) for x, y in places.tolist())


def intruder(
    discs: Sequence[Disc], obstacles: Obstacles, gaps: NDArray[np.float64], arm: Sequence[Disc] = ()
) -> Intruder | None:
    """Return the obstacle in the swept space that is nearest to the base (`gaps`: one for each obstacle).

    An obstacle deep inside the present arm (`arm`) does not count: it is above the arm, below it, or the arm
    itself.
    """
    inside = (_depth(discs, obstacles.points) >= 0.0) & (_depth(arm, obstacles.points) < UNDER_M)
    rows = np.flatnonzero(inside)
    if not len(rows):
        return None
    row = rows[np.argmin(gaps[rows])]
    x, y = obstacles.points[row]
    return Intruder(int(obstacles.source[row]), float(gaps[row]), math.atan2(y, x))


def _depth(discs: Sequence[Disc], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how deep each point is inside the union of the discs (m); negative outside."""
    deepest = np.full(len(points), -math.inf)
    for x, y, radius in discs:
        np.maximum(deepest, radius - np.hypot(points[:, 0] - x, points[:, 1] - y), out=deepest)
    return deepest
