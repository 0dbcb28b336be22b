"""The arm as part of the footprint: discs along its links (docs/gate.md, 9)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SPACING = 1.5  # between the middles of two discs, in radii of the arm
AWAY_MPS = 0.2  # speed limit while the arm is away from home at an unknown place
UNDER_M = 0.05  # a point that is deeper inside an arm's disc is below or above the arm
KNOWN_S = 0.5  # a posture older than this is unknown
LATELY_S = 1.0  # a picture that comes now may show where the arm was up to this time ago

Disc = tuple[float, float, float]


class Posture(NamedTuple):
    """Posture of the arm: at home, away with known discs (x, y, radius; base frame, metres), or away and unknown.

    `ends`: discs about the arm's ends; points that a camera sees there may be the robot itself. `reach`: disc
    in which a camera may see the arm anywhere, because the arm moves or its place is unknown.
    """

    at_home: bool
    discs: tuple[Disc, ...] | None = None
    ends: tuple[Disc, ...] = ()
    reach: Disc | None = None


ANYWHERE: Disc = (0.0, 0.0, 1.2)  # an arm with unknown posture
AT_HOME = Posture(at_home=True, discs=())
UNKNOWN = Posture(at_home=False)


def is_home(positions: Mapping[str, float], home: Mapping[str, float], tolerance: float) -> bool | None:
    """Return whether every joint is at home within `tolerance` (rad or m); None if a joint is unknown."""
    if not home.keys() <= positions.keys():
        return None
    return all(abs(positions[joint] - at) <= tolerance for joint, at in home.items())


def discs_along(line: NDArray[np.float64], radius_m: float) -> tuple[Disc, ...]:
    """Return discs that cover an arm of this radius, seen from above.

    `line`: the origins of its links (N, 2 or 3; base frame).
    """
    kept: list[NDArray[np.float64]] = []
    for middle in middles_along(line[:, :2], radius_m):
        # links above one another are one disc
        if not kept or np.hypot(*(np.array(kept) - middle).T).min() > radius_m / 4.0:
            kept.append(middle)
    radius = covering_m(radius_m)
    return tuple((float(x), float(y), radius) for x, y in kept)


def middles_along(lines: NDArray[np.float64], radius_m: float) -> NDArray[np.float64]:
    """Return places (M, 2) along lines of link origins (..., N, 2), close enough for `covering_m` discs."""
    begin, link = lines[..., :-1, :], np.diff(lines, axis=-2)
    pieces = max(
        math.ceil(float(np.hypot(link[..., 0], link[..., 1]).max(initial=0.0)) / (SPACING * radius_m)), 1
    )
    shares = np.arange(pieces)[:, None] / pieces
    along = begin[..., None, :] + shares * link[..., None, :]
    return np.concatenate((along.reshape(-1, 2), lines[..., -1, :].reshape(-1, 2)))


def covering_m(radius_m: float) -> float:
    """Return the radius at which discs s apart cover the whole width of the arm: sqrt(r^2 + (s/2)^2)."""
    return radius_m * math.hypot(1.0, SPACING / 2.0)


def beyond(discs: tuple[Disc, ...], base_radius_m: float) -> tuple[Disc, ...]:
    """Return the discs that reach out of a base of this radius."""
    return tuple(disc for disc in discs if math.hypot(disc[0], disc[1]) + disc[2] > base_radius_m)
